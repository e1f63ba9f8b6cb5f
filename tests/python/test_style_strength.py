# SPDX-License-Identifier: GPL-3.0-or-later
"""A style's strength is even: a share of it moves a figure by about that share of the way."""

import sys
from pathlib import Path

import numpy as np
import pytest

import arapfields as af

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "blender_scripts"))
import creatures

EVEN = 0.15  # of the share; for a cube


@pytest.mark.parametrize("name", ["dog", "dinosaur"])
def test_a_share_of_the_strength_goes_that_share_of_the_way(name):
    shape = creatures.load(name)
    rest, triangles, up = shape.vertices.astype(float), shape.triangles, [0, 0, 1]
    samples = af.sample_mesh(rest, triangles, count=20000, seed=0)

    def way(strength):
        before = {"centers": af.CENTERS_BEFORE_SHARPEN, "iterations": af.ITERATIONS_BEFORE_SHARPEN}
        options = af.StylizeOptions(strength=strength, **before)
        moved = af.stylize(samples, "cube", options)(rest)
        sharpened = af.sharpen(rest, triangles, moved, "cube", af.SharpenOptions(strength=strength), up=up)
        return np.linalg.norm(sharpened - rest, axis=1).mean()

    whole = way(1.0)
    for share in (0.25, 0.5, 0.75):
        assert way(share) / whole == pytest.approx(share, rel=EVEN)
