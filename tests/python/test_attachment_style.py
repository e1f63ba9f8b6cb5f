# SPDX-License-Identifier: GPL-3.0-or-later
"""What a body carries under a style: the field is steep off the surface, the frames are not."""

import numpy as np
import pytest
from support.geometry.characters import trousers

import arapfields as af

spatial = pytest.importorskip("scipy.spatial")

SIZE = 0.97  # of the body, as attachments measure it
MOST = 2.0  # times as long: what an edge becomes, where the surface below takes 1.6 to 2


@pytest.fixture(scope="module")
def styled():
    body = af.sample_surface(trousers(), 5000, seed=0)
    return body, af.stylize(body, "cube", up=[0, 0, 1])


@pytest.mark.parametrize("share", [0.01, 0.02, 0.03, 0.04, 0.05])
def test_clothes_at_any_distance_keep_together_under_a_style(styled, share):
    body, field = styled
    points = body.points[::2] + share * SIZE * body.normals[::2]
    edges = spatial.cKDTree(points).query_pairs(0.02 * SIZE, output_type="ndarray")
    before = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    long = before > 0.005 * SIZE
    moved = af.Attachment(body, points).positions(field)
    after = np.linalg.norm(moved[edges[:, 0]] - moved[edges[:, 1]], axis=1)
    assert (after / before)[long].max() < MOST
