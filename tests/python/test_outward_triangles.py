# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes whose faces point inwards, all of them or some, give what the clean ones give."""

import numpy as np
import pytest
from support.geometry.cases import box, moved, turn

import arapfields as af

TURNED = [0, 2, 1]  # order of corners that faces the other way


def sphere(radius=1.0, center=(0.0, 0.0, 0.0), rows=16, columns=24, lowest=0.0):
    """Vertices and triangles facing outwards; `lowest`: rows left out below, as a share, for an open neck."""
    angles = np.linspace(0.0, np.pi * (1.0 - lowest), rows + 1)
    around = np.linspace(0.0, 2.0 * np.pi, columns, endpoint=False)
    place = np.array(
        [[(np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)) for b in around] for a in angles]
    ).reshape(-1, 3)
    faces = []
    for i in range(rows):
        for j in range(columns):
            a, b = i * columns + j, i * columns + (j + 1) % columns
            c, d = a + columns, b + columns
            faces += [(a, c, d), (a, d, b)]
    return radius * place + np.asarray(center), np.array(faces)


def rope(turns=1.5, length=60, around=12, thickness=0.05):
    """A closed tube about a helix."""
    t = np.linspace(0.0, 1.0, length)
    a = 2.0 * np.pi * turns * t
    middle = np.c_[np.cos(a) * 0.5, np.sin(a) * 0.5, t - 0.5]
    along = np.gradient(middle, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    out = np.c_[np.cos(a), np.sin(a), 0.0 * a]
    side = np.cross(along, out)
    out = np.cross(side, along)
    b = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    ring = middle[:, None] + thickness * (
        np.cos(b)[None, :, None] * out[:, None] + np.sin(b)[None, :, None] * side[:, None]
    )
    vertices = np.vstack([ring.reshape(-1, 3), middle[[0, -1]]])
    faces, first, last = [], length * around, length * around + 1
    for i in range(length - 1):
        for j in range(around):
            p, q = i * around + j, i * around + (j + 1) % around
            faces += [(p, q, q + around), (p, q + around, p + around)]
    for j in range(around):
        faces += [(first, (j + 1) % around, j)]
        end = (length - 1) * around
        faces += [(last, end + j, end + (j + 1) % around)]
    faces = np.array(faces)
    corners = vertices[faces]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return vertices, faces if volume > 0.0 else faces[:, TURNED]


def together(*meshes):
    ends = np.cumsum([0] + [len(v) for v, _ in meshes])
    return np.vstack([v for v, _ in meshes]), np.vstack(
        [f + n for (_, f), n in zip(meshes, ends, strict=False)]
    )


def turned(triangles, which):
    result = triangles.copy()
    result[which] = result[which][:, TURNED]
    return result


SHAPES = {
    "sphere": sphere(),
    "rope": rope(),
    "two apart": together(sphere(0.5), sphere(0.3, (2.0, 0.0, 0.0))),
    "hollow": together(sphere(1.0), (sphere(0.7)[0], sphere(0.7)[1][:, TURNED])),
    "eyeball": together(sphere(1.0), sphere(0.2, (0.0, 0.6, 0.1))),
    "open neck": sphere(lowest=0.12),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("share", [1.0, 0.45])
def test_faces_that_point_inwards_are_turned_for_sampling(name, share):
    vertices, triangles = SHAPES[name]
    rng = np.random.default_rng(5)
    wrong = turned(triangles, rng.random(len(triangles)) < share)
    clean, mended = af.sample_mesh(vertices, triangles), af.sample_mesh(vertices, wrong)
    assert np.array_equal(clean.points, mended.points)
    assert np.array_equal(clean.normals, mended.normals)


@pytest.mark.parametrize("name", ["sphere", "hollow", "eyeball"])
def test_signed_distances_do_not_depend_on_where_faces_point(name):
    vertices, triangles = SHAPES[name]
    points = np.random.default_rng(6).uniform(-1.2, 1.2, (200, 3))
    inwards = turned(triangles, slice(None))
    expected = af.signed_distance(vertices, triangles, points)
    assert np.array_equal(af.signed_distance(vertices, inwards, points), expected)
    sdf, other = af.MeshSdf(vertices, triangles), af.MeshSdf(vertices, inwards)
    cube = sdf.frame.to_cube(points) if hasattr(sdf.frame, "to_cube") else points
    assert np.array_equal(other(cube), sdf(cube))


def test_a_rope_inside_out_is_as_soft_as_the_clean_one():
    vertices, triangles = rope()
    low, high = vertices.min(0), vertices.max(0)
    held = moved(box(low - 0.1, (*(high + 0.1)[:2], low[2] + 0.15)))
    pulled = moved(box((*(low - 0.1)[:2], high[2] - 0.15), high + 0.1), turn((0, 0, 1), 60.0))
    fields = [
        af.deform(af.sample_mesh(vertices, faces), [held, pulled])
        for faces in (triangles, turned(triangles, slice(None)))
    ]
    assert fields[1].report.energy == fields[0].report.energy
    assert np.array_equal(
        fields[1].apply(vertices, triangles=turned(triangles, slice(None))),
        fields[0].apply(vertices, triangles=triangles),
    )


def test_open_sheets_keep_the_side_that_they_face():
    x = np.linspace(-1.0, 1.0, 9)
    grid = np.array([(a, b, 0.2 * a * a) for a in x for b in x])
    faces = np.array(
        [
            f
            for i in range(8)
            for j in range(8)
            for f in (
                (9 * i + j, 9 * i + j + 9, 9 * i + j + 10),
                (9 * i + j, 9 * i + j + 10, 9 * i + j + 1),
            )
        ]
    )
    up = af.sample_mesh(grid, faces).normals[:, 2]
    down = af.sample_mesh(grid, turned(faces, slice(None))).normals[:, 2]
    assert np.array_equal(up, -down)
    few = turned(faces, np.arange(0, len(faces), 7))
    assert np.array_equal(af.sample_mesh(grid, few).normals[:, 2], up)


def test_a_strip_with_one_side_is_sampled():
    a = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    middle = np.c_[np.cos(a), np.sin(a), 0 * a]
    arm = np.c_[np.cos(a / 2) * np.cos(a), np.cos(a / 2) * np.sin(a), np.sin(a / 2)]
    vertices = np.vstack([middle - 0.2 * arm, middle + 0.2 * arm])
    n = len(a)
    faces = [(i, i + 1, i + 1 + n) for i in range(n - 1)] + [(i, i + 1 + n, i + n) for i in range(n - 1)]
    faces += [(n - 1, n, 0), (n - 1, 0, 2 * n - 1)]
    samples = af.sample_mesh(vertices, np.array(faces))
    assert np.allclose(np.linalg.norm(samples.normals, axis=1), 1.0)
