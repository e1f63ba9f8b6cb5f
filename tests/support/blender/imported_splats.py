# SPDX-License-Identifier: GPL-3.0-or-later
"""Script for a separate Blender with splats of its own: compares what its importers read with arrays.

python imported_splats.py ARRAYS.npz FILE.ply FILE.glb …
"""

import sys
from pathlib import Path

import bpy
import numpy as np

CLOSE = 1e-5


def imported(path):
    if path.suffix == ".glb":
        bpy.ops.import_scene.gltf(filepath=str(path))
    else:
        bpy.ops.wm.ply_import(filepath=str(path), forward_axis="Y", up_axis="Z")
    return bpy.context.object


def gap(item, wanted):
    """The largest difference of an attribute, with rotations up to their sign."""
    assert (item.type, item.data.type) == ("POINTCLOUD", "GAUSSIAN_SPLAT")
    assert np.abs(np.array(item.matrix_world) - np.eye(4)).max() < 1e-6
    gaps = []
    for key, values in wanted.items():
        attribute = item.data.attributes[key]
        flat = np.empty(values.size, np.float32)
        attribute.data.foreach_get("value" if attribute.data_type == "QUATERNION" else "vector", flat)
        got = flat.reshape(values.shape)
        if key == "rotation":
            got = got * np.sign(np.sum(got * values, axis=1, keepdims=True))
        gaps.append(np.abs(got - values).max())
    return max(gaps)


def main():
    arrays, *paths = map(Path, sys.argv[1:])
    bpy.ops.wm.read_homefile(use_empty=True)
    wanted = dict(np.load(arrays))
    gaps = {path.name: gap(imported(path), wanted) for path in paths}
    assert max(gaps.values()) < CLOSE, gaps
    print("IMPORTED", bpy.app.version_string, gaps)


if __name__ == "__main__":
    main()
