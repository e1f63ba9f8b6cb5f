# SPDX-License-Identifier: GPL-3.0-or-later
"""Edges of triangle meshes, against a search one by one."""

import numpy as np
import pytest

from addon.core.geometry import uv_transfer
from addon.core.geometry.edge_paths import carried_marks
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


def grid(columns, rows, shift=0.0):
    """(n, 3), (m, 2), [quads]: a unit sheet, its inner vertices moved at random."""
    x, y = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    inner = (points[:, :2] > 0).all(axis=1) & (points[:, :2] < 1).all(axis=1)
    points[inner, :2] += shift * np.random.default_rng(0).uniform(-1, 1, (inner.sum(), 2))
    at = np.arange(len(points)).reshape(x.shape)
    quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    edges = np.unique(np.sort(np.stack([quads, np.roll(quads, -1, 1)], -1).reshape(-1, 2), axis=1), axis=0)
    return points, edges, quads


def test_a_marked_line_stays_one_line_on_other_edges():
    vertices, edges, _ = grid(13, 13, 0.02)
    line = np.stack([np.full(6, 0.45), np.linspace(0, 1, 6), np.zeros(6)], axis=1)
    ends = np.stack([line[:-1], line[1:]], axis=1)
    nearest = ((vertices[None] - ends.reshape(-1, 1, 3)) ** 2).sum(-1).argmin(1).reshape(-1, 2)
    found = carried_marks(ends, np.full(5, 0.7), nearest, vertices, edges)
    chosen = edges[found > 0]
    assert set(found[found > 0]) == {0.7} and len(chosen) == 13
    assert np.abs(vertices[chosen][:, :, 0] - 0.45).max() < 0.08
    assert sorted(np.bincount(chosen.ravel())[np.unique(chosen)]) == [1, 1] + [2] * 12


def test_a_face_across_a_seam_keeps_the_texture_of_its_centre():
    """Two islands meet at x = 0.5; the other mesh has faces across."""
    source, _, quads = grid(4, 4)
    triangles = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    right = source[triangles].mean(axis=1)[:, 0] > 0.5
    uv = source[triangles][:, :, :2] + right[:, None, None] * [5.0, 0.0]
    vertices, _, faces = grid(5, 3)
    corners, starts = faces.ravel(), 4 * np.arange(len(faces))
    points, _, face = uv_transfer.fan(vertices, starts, corners)
    centres = source[triangles].mean(axis=1)
    places = ((points[:, None] - centres) ** 2).sum(-1).argmin(1)
    edges = np.stack([source[triangles][:, k] for k in range(3)], axis=2)[places]
    shares = np.linalg.solve(
        edges + [[0], [0], [1]] * np.ones((1, 3, 3)), (points + np.eye(3)[2])[:, :, None]
    )
    found, beyond = uv_transfer.corner_coordinates(
        points, places, shares[:, :, 0], corners, face, source[triangles], uv
    )
    across = points[len(vertices) :][face][:, 0] > 0.5
    assert beyond.any() and len(set(face[beyond].tolist())) <= 6
    told = vertices[corners][:, :2]
    off = found - told - across[:, None] * [5.0, 0.0]
    middle = np.abs(points[len(vertices) :][face][:, 0] - 0.5) < 1e-9  # whose centre is on the seam itself
    assert np.abs(off[~middle]).max() < 1e-9
    assert (np.ptp(found.reshape(-1, 4, 2)[:, :, 0], axis=1) < 0.3).all()
