# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices at tips, between the samples of their mesh, stay outside of obstacles as these do."""

import numpy as np
import pytest
import trimesh
from support.geometry.bar import box, turned
from support.geometry.contact_bar import solid
from support.geometry.meshes import sphere

import arapfields as af

COUNT = 3000
DEEPEST = 0.001  # of the size
FLIPPED = 0.001  # of the samples, at spikes of a few centers
FEW = af.DeformOptions(centers=200)
QUICK = af.LiveOptions(samples=1200, coarse_centers=40, fine_centers=200)
TOP = box([0, 0, 0.45], [0.5, 0.5, 0.25])
WAY = -0.25
GROUND = -1.0


def urchin(spikes, long, subdivisions):
    """A ball of radius 0.7 with spikes of one vertex each, apart from each other by chance."""
    vertices, triangles = sphere(0.7, subdivisions)
    rows = np.random.default_rng(spikes).permutation(len(vertices))
    chosen = []
    for row in rows:
        if all(np.linalg.norm(vertices[row] - vertices[other]) > 0.3 for other in chosen):
            chosen.append(row)
    vertices[chosen[:spikes]] *= long
    return vertices, triangles


def crystal():
    """Eight corners on a box that stands on one of them."""
    mesh = trimesh.creation.box((1, 1, 1)).subdivide()
    to = trimesh.geometry.align_vectors([1, 1, 1], [0, 0.1, -1])
    return mesh.vertices @ to[:3, :3].T, mesh.faces


def cone():
    """Of eight sides, on its tip."""
    mesh = trimesh.creation.cone(0.6, 1.7, sections=8).subdivide()
    return mesh.vertices @ np.diag([1.0, -1, -1]) + [0, 0, 0.7], mesh.faces


SHAPES = {
    "urchin": lambda: urchin(40, 1.4, 3),
    "coarse urchin": lambda: urchin(20, 1.5, 2),
    "dense urchin": lambda: urchin(60, 1.3, 4),
    "crystal": crystal,
    "cone": cone,
}
BALL = solid(trimesh.creation.icosphere(4, 2.0), [0, 0, GROUND - 2.0])
PLATE = solid(trimesh.creation.box((4, 4, 0.1)), [0, 0, GROUND - 0.05])


def outside(function, points):
    return points[:, 2] - GROUND if function is None else np.asarray(function(points))


def contact(function):
    return af.Contact(ground=GROUND) if function is None else af.Contact([af.Obstacle(function)])


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("function", [None, BALL, PLATE], ids=["ground", "ball", "plate"])
def test_no_vertex_at_a_tip_is_inside(name, function):
    vertices, triangles = SHAPES[name]()
    vertices[:, 2] += GROUND + 0.05 - vertices[:, 2].min()
    size = np.ptp(vertices, axis=0).max()
    samples = af.sample_mesh(vertices, triangles, COUNT, seed=0)
    ways = [turned(0, shift=(0, 0, share * WAY)) @ TOP for share in (0.3, 0.6, 1.0)]
    field = af.deform(samples, [af.Cuboid(TOP, ways[-1])], FEW, contact=contact(function))
    live = af.LiveDeformer(samples, [af.Cuboid(TOP, TOP)], QUICK, contact=contact(function))
    for way in ways:
        dragged = live.solve([way], iterations=30)
    for shape in (field, dragged):
        lowest, sample = (outside(function, np.asarray(shape(at))).min() for at in (vertices, samples.points))
        assert lowest > -DEEPEST * size
        assert min(lowest, sample) < 2 * DEEPEST * size  # it stands there
        assert shape.report.flipped_share < FLIPPED


def test_a_cancelled_contact_is_as_if_it_had_not_been_asked_for():
    vertices, triangles = SHAPES["urchin"]()
    samples = af.sample_mesh(vertices, triangles, COUNT, seed=0)
    live, free = (af.LiveDeformer(samples, [af.Cuboid(TOP, TOP)], QUICK) for _ in range(2))
    way = turned(0, shift=(0, 0, WAY)) @ TOP
    task = af.Task()
    task.cancel()
    with pytest.raises(af.Cancelled):
        live.set_contact(contact(None), task=task)
    assert np.array_equal(live.solve([way])(vertices), free.solve([way])(vertices))
    live.set_contact(contact(None))
    moved = live.solve([way], iterations=30)(vertices)
    assert outside(None, moved).min() > -DEEPEST * np.ptp(vertices, axis=0).max()
