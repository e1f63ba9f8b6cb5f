# SPDX-License-Identifier: GPL-3.0-or-later
"""Weights and eight correctives of a child of 50,000 vertices with 25 and 200 bones."""

import json
import subprocess
import sys
import tempfile

import bpy  # noqa: F401  (the child's modules are Blender's)
import numpy as np

import arapfields as af

CELLS = 201
COUNTS = (25, 200)


def rig(joints, count):
    """The joints' bones, subdivided evenly to `count`."""
    bones, last = [], {}
    for number, (name, (parent, head, tail)) in enumerate(joints.items()):
        pieces = count // len(joints) + (number < count % len(joints))
        ends = np.linspace(head, tail, pieces + 1)
        for k in range(pieces):
            bones.append(af.Bone(ends[k], ends[k + 1], last.get(parent) if k == 0 else len(bones) - 1))
        last[name] = len(bones) - 1
    return bones


MEASURE = """
import numpy as np, re, sys, time, json, arapfields as af
shape = np.load(sys.argv[1])
vertices, triangles, ends, parents = (shape[name] for name in ("vertices", "triangles", "ends", "parents"))
bones = [af.Bone(*pair, None if p < 0 else int(p)) for pair, p in zip(ends, parents)]
options = af.SkinOptions(correctives=8, threads=2)
begin = time.perf_counter()
weights = af.skin_weights((vertices, triangles), bones, options)
middle = time.perf_counter()
af.skin_correctives(vertices, triangles, bones, weights, options)
print(json.dumps({
    "vertices": len(vertices), "bones": len(bones), "weights_s": round(middle - begin, 1),
    "correctives_s": round(time.perf_counter() - middle, 1),
    "peak_mb": int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1]) // 1024,
}))
"""


def run():
    """A row per number of bones, each measured in a separate process."""
    import people

    body, rows = people.body(cells=CELLS), []
    for count in COUNTS:
        bones = rig(people.JOINTS, count)
        ends = [(bone.head, bone.tail) for bone in bones]
        parents = [-1 if bone.parent is None else bone.parent for bone in bones]
        with tempfile.NamedTemporaryFile(suffix=".npz") as file:
            np.savez(
                file,
                vertices=body.vertices.astype(float),
                triangles=body.triangles,
                ends=ends,
                parents=parents,
            )
            file.flush()
            done = subprocess.run([sys.executable, "-c", MEASURE, file.name], capture_output=True, check=True)
        rows.append(json.loads(done.stdout))
    return rows
