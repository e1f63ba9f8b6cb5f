# SPDX-License-Identifier: GPL-3.0-or-later
"""What we write of splats is read by Blender's own importers, where it has splats of its own."""

import numpy as np
import pytest
from support.blender import blenders
from support.geometry import cases
from support.geometry.scan import splats

from arapfields.cli import splat_files

MOTION = (
    cases.turn([1, 2, 3], 130, (0.2, 0.1, -0.3)) @ cases.shift([0.4, -0.2, 0.1]) @ np.diag([1.5, 1.5, 1.5, 1])
)


@pytest.mark.parametrize("count", [1, 4, 16])
def test_blenders_own_importers_read_the_same_splats(count, tmp_path):
    newest = blenders.find(blenders.VERSIONS[-1], tmp_path)
    posed = splats(500, count).transformed(MOTION)
    arrays = {"position": posed.centers, "rotation": posed.rotations, "scale": posed.scales}
    arrays["radiance:base"] = np.column_stack([posed.harmonics[:, 0], posed.opacities])
    arrays |= {f"radiance:sh_{k - 1}": posed.harmonics[:, k] for k in range(1, count)}
    np.savez(tmp_path / "posed.npz", **arrays)
    paths = [tmp_path / f"posed{suffix}" for suffix in splat_files.FRAMED]
    for path in paths:
        splat_files.write(path, posed)
    done = newest.run("imported_splats.py", tmp_path / "posed.npz", *paths)
    assert "IMPORTED" in done.stdout
