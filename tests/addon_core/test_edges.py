# SPDX-License-Identifier: GPL-3.0-or-later
"""Edges of triangle meshes, against a search one by one."""

import numpy as np
import pytest

from addon.core.geometry.edges import build_edges

TETRAHEDRON = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]


@pytest.mark.parametrize("corners", [TETRAHEDRON, TETRAHEDRON[:2], TETRAHEDRON[:1]])
def test_every_edge_is_there_once(corners):
    topology = build_edges(np.array(corners))
    expected = {tuple(sorted((t[k], t[(k + 1) % 3]))) for t in corners for k in range(3)}
    assert len(topology) == len(corners)
    assert sorted(map(tuple, topology.edges)) == sorted(expected)
    for triangle, edges in zip(corners, topology.corner_edges, strict=True):
        for k in range(3):
            assert tuple(topology.edges[edges[k]]) == tuple(sorted((triangle[k], triangle[(k + 1) % 3])))


def test_large_numbers_of_vertices_do_not_overflow():
    last = 2**31 - 1
    topology = build_edges(np.array([[last - 2, last - 1, last]]))
    assert sorted(map(tuple, topology.edges)) == [(last - 2, last - 1), (last - 2, last), (last - 1, last)]
