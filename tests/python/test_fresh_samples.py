# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples newly drawn from the surface at each step of a solve."""

import numpy as np
import pytest
from support.geometry import meshes

import arapfields as af


def test_fresh_samples_are_drawn_from_the_surface():
    V, F = meshes.torus(around=24, tube=12)
    box = np.diag([0.4, 3.0, 3.0, 1.0])
    here, moved = np.eye(4), np.eye(4)
    here[0, 3], moved[0, 3] = -1.0, 1.0
    lift = np.eye(4)
    lift[2, 3] = 0.5
    handles = [af.Cuboid(here @ box, here @ box), af.Cuboid(moved @ box, lift @ moved @ box)]
    few = af.sample_mesh(V, F, count=300, seed=1)
    settings = {"iterations": 12, "width": 16, "layers": 2, "seed": 3, "threads": 1}

    def solve(samples, fresh):
        return af.deform(samples, handles, af.DeformOptions(fresh_samples=fresh, **settings))(V)

    assert not np.array_equal(solve(few, 100), solve(few, 0))
    assert np.array_equal(solve(few, 100), solve(few, 100))
    with pytest.raises(af.InvalidInput, match="fresh_samples"):
        solve(af.SurfaceSamples(few.points, few.normals), 100)
    with pytest.raises(af.InvalidInput, match="fresh_samples"):
        solve(few, -1)
