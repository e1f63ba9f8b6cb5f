# SPDX-License-Identifier: GPL-3.0-or-later
"""The report tells what happens to the mesh's own triangles, not to samples alone."""

import numpy as np
from support.geometry.cases import box, moved, turn

import arapfields as af


def strips(columns):
    """A bar along x from −1 to 1 whose long sides have so many columns of triangles."""
    x = np.linspace(-1.0, 1.0, columns + 1)
    ring = 0.15 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    vertices = np.array([(a, *p) for a in x for p in ring])
    faces = []
    for i in range(columns):
        for k in range(4):
            a, b = 4 * i + k, 4 * i + (k + 1) % 4
            faces += [(a, b + 4, b), (a, a + 4, b + 4)]
    end = 4 * columns
    faces += [(0, 1, 2), (0, 2, 3), (end, end + 2, end + 1), (end, end + 3, end + 2)]
    return vertices, np.array(faces)


def bent(vertices, triangles, degrees, pivot=(0.0, 0.0, 0.0)):
    ends = [
        moved(box((-1.1, -0.3, -0.3), (-0.8, 0.3, 0.3))),
        moved(box((0.8, -0.3, -0.3), (1.1, 0.3, 0.3)), turn((0, 0, 1), degrees, pivot)),
    ]
    return af.deform(af.sample_mesh(vertices, triangles), ends)


def test_a_fine_bar_is_bent_without_a_note():
    assert bent(*strips(40), 60.0).report.notes == ()


def test_stretches_of_the_mesh_s_own_triangles_are_in_the_report():
    vertices, triangles = strips(24)
    field = bent(vertices, triangles, 80.0)
    stretches = np.linalg.svd(field.jacobian(vertices[triangles].mean(axis=1)), compute_uv=False)
    rounding = 1e-9
    assert field.report.max_stretch >= stretches.max() - rounding
    assert field.report.min_determinant <= np.prod(stretches, axis=1).min() + rounding


def test_triangles_too_long_for_the_motion_are_told_of_with_a_place():
    # Slivers that reach along the whole bar, in a plane: its one end comes round to behind the other one.
    vertices, triangles = strips(40)
    rows = np.linspace(-0.15, 0.15, 30)
    extra = np.array([(side, y, 0.15) for y in rows for side in (-1.0, 1.0)])
    start = len(vertices)
    slivers = [(start + 2 * i, start + 2 * i + 1, start + 2 * i + 2) for i in range(29)]
    field = bent(np.vstack([vertices, extra]), np.vstack([triangles, slivers]), 140.0, (-0.3, 0.0, 0.0))
    mesh_vertices, mesh_triangles = np.vstack([vertices, extra]), np.vstack([triangles, slivers])
    corners = field.apply(mesh_vertices, triangles=mesh_triangles)[mesh_triangles]
    rest = mesh_vertices[mesh_triangles]
    before = np.cross(rest[:, 1] - rest[:, 0], rest[:, 2] - rest[:, 0])
    after = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    jacobians = field.jacobian(rest.mean(axis=1))
    expected = np.einsum("nji,nj->ni", np.linalg.inv(jacobians), before)
    turned = (np.linalg.det(jacobians) > 0) & ((expected * after).sum(axis=1) < 0)
    told = [note for note in field.report.notes if "turn over" in note]
    assert turned.sum() > 0.002 * len(mesh_triangles)
    assert told[0].startswith(f"{turned.sum()} of {len(mesh_triangles)} triangles turn over")
