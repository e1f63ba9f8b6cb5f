# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact of a figure with itself, where its parts cut each other at rest."""

import numpy as np
import pytest
import trimesh
from support.geometry import contact_cases
from support.geometry.bar import box, turned
from support.geometry.cases import turn
from support.geometry.characters import FOOT, HIP, LEG, trousers
from support.geometry.parts import figure

import arapfields as af

TRUNK = box([0, 0, 0.7], [0.12] * 3)
HANDS = [box([side * 0.5, 0, 0.8], [0.06] * 3) for side in (1, -1)]
HEIGHT = 1.4
# Of the samples, more than without contact: some flip for a step where arms are pressed on. What pushed its
# own other side flipped .48, with 21 times the energy.
FLIPPED = 0.03
# Of the energy without contact: with other samples up to 1.26, and 3.1 where arms crumple.
PRESSED, CRUMPLED = 1.6, 6.0
# Energy of a leg turned into the other, which keeps its shape: .044 and .119; squashed .34 and .28.
KEEPS_ITS_SHAPE = 0.2
# Of the area, inside another part.
INSIDE = 5e-4
# Energy of a paw that ends at the neck, .059 to .074 in four samples; of one that presses it flat, .116
# to .127.
NOT_FLAT = 0.09

# Distances at rest of triangles: those of different legs are farther from each other than the first, those of
# legs that are far through the inside nearer than the second.
BESIDE, ACROSS = 0.1, 0.2


def drag(live, way, steps=11):
    """Both hands inwards, along and up by `way`, and back: (shares flipped, energy at the far end)"""
    flipped, energies = [], []
    for k in np.r_[np.linspace(0, 1, steps), np.linspace(1, 0, steps)]:
        ways = [k * np.multiply((side, 1, 1), way) for side in (-1, 1)]
        pose = [TRUNK, *(turned(0, shift=w) @ hand for w, hand in zip(ways, HANDS, strict=True))]
        live.follow(pose)
        flipped.append(live.report.flipped_share)
        energies.append(live.report.energy)
    return flipped, energies[steps - 1]


@pytest.mark.parametrize(
    ("way", "crumples"),
    [((0.3, -0.2, -0.3), False), ((0.25, -0.12, -0.4), False), ((0.35, -0.15, -0.1), True)],
)
def test_parts_that_cut_each_other_are_dragged_as_without_contact(way, crumples):
    """Arms pushed into the trunk crumple, with contact or without."""
    vertices, triangles, _ = figure(16)
    samples = af.sample_mesh(vertices, triangles, 8000, seed=0)
    handles = [af.Cuboid(m, m) for m in (TRUNK, *HANDS)]
    free = drag(af.LiveDeformer(samples, handles), way)
    live = af.LiveDeformer(samples, handles, contact=af.Contact(itself=True))
    rest = live.solve(iterations=60)(vertices)
    flipped, energy = drag(live, way)
    back = live.solve([TRUNK, *HANDS], iterations=200, tolerance=1e-6)(vertices)  # from crumples takes long
    assert np.abs(back - rest).max() < 1e-3 * HEIGHT
    assert max(flipped) <= max(free[0]) + FLIPPED
    assert energy < (CRUMPLED if crumples else PRESSED) * free[1]


@pytest.mark.parametrize("aside", [0.0, 0.03])
def test_feet_that_jump_past_each_other_do_not_end_in_each_other(aside):
    """Turned by 30°, each to beyond the other, in one solve, where large steps pass what they meet."""
    vertices, triangles = af.extract_surface(trousers(), 48)[:2]
    samples = af.sample_mesh(vertices, triangles, 5000, seed=0)
    trunk = box([0, 0, 1.1], [0.3, 0.3, 0.3])
    handles = [af.Cuboid(trunk, trunk)]
    for side in (-1, 1):
        foot = box([side * LEG, 0, FOOT], [0.1, 0.1, 0.1])
        handles.append(af.Cuboid(foot, turned(-30 * side, shift=(-4 * side * LEG, -side * aside, 0)) @ foot))
    field = af.deform(samples, handles, af.DeformOptions(centers=600), contact=af.Contact(itself=True))
    for _ in range(2):  # so that no vertex stands for more than that of the area
        vertices, triangles = trimesh.remesh.subdivide(vertices, triangles)
    assert contact_cases.overlapping(vertices, field(vertices), triangles) < INSIDE
    assert field.report.flipped_share == 0


def figure_with_feet(count=5000):
    """Trousers, and handles of the trunk and both feet."""
    vertices, triangles = af.extract_surface(trousers(), 40)[:2]
    rest = [box([0, 0, 1.1], [0.3] * 3), *(box([side * LEG, 0, FOOT], [0.1] * 3) for side in (-1, 1))]
    return vertices, triangles, af.sample_mesh(vertices, triangles, count, seed=0), rest


def pairs_that_cross(vertices, triangles, rest, far):
    """Pairs of triangles so far from each other at rest, of which an edge of one passes through the other."""
    corners, middles = vertices[triangles], rest[triangles].mean(1)
    low, high = corners.min(1), corners.max(1)
    pairs = set()
    for i in range(len(triangles)):
        j = np.flatnonzero((low <= high[i]).all(1) & (high >= low[i]).all(1))
        for other in j[np.linalg.norm(middles[j] - middles[i], axis=1) > far]:
            for edges, face in ((corners[i], corners[other]), (corners[other], corners[i])):
                start, way = edges, np.roll(edges, -1, 0) - edges
                a, first, second = face[0], face[1] - face[0], face[2] - face[0]
                parts = np.linalg.solve(
                    np.stack([np.tile(first, (3, 1)), np.tile(second, (3, 1)), -way], 2),
                    (start - a)[..., None],
                )
                u, v, t = parts[..., 0].T
                if ((u > 0) & (v > 0) & (u + v < 1) & (t > 0) & (t < 1)).any():
                    pairs.add((min(i, other), max(i, other)))
    return len(pairs)


@pytest.mark.parametrize("aside", [0.0, 0.03])
def test_legs_moved_into_each_other_end_apart(aside):
    """Each half of the way to the other, where neither is the one that gives way."""
    vertices, triangles, samples, rest = figure_with_feet()
    handles = [af.Cuboid(rest[0], rest[0])]
    for side, foot in zip((-1, 1), rest[1:], strict=True):
        handles.append(af.Cuboid(foot, turned(0, shift=(-side * LEG, side * aside, 0)) @ foot))
    field = af.deform(samples, handles, af.DeformOptions(centers=400), contact=af.Contact(itself=True))
    assert field.report.contact.self_intersections == 0
    assert pairs_that_cross(field(vertices), triangles, vertices, BESIDE) == 0


def test_a_report_counts_parts_that_pass_through_each_other():
    vertices, triangles, samples, rest = figure_with_feet(3000)
    live = af.LiveDeformer(samples, [af.Cuboid(m, m) for m in rest])
    feet = [turned(0, shift=(-side * LEG, 0, 0)) @ foot for side, foot in zip((-1, 1), rest[1:], strict=True)]
    free = live.solve([rest[0], *feet], iterations=40)
    assert free.report.contact.self_intersections is None
    live.set_contact(af.Contact(itself=True))
    report = live.solve(iterations=1).report
    least, most = (
        pairs_that_cross(live.field(vertices), triangles, vertices, far) for far in (ACROSS, BESIDE)
    )
    crossing = report.contact.self_intersections
    assert 0 < least <= crossing <= most
    assert f"{crossing} pairs of triangles" in " ".join(report.notes)
    without = af.LiveDeformer(
        af.SurfaceSamples(samples.points, samples.normals, samples.frame),
        [af.Cuboid(rest[0], rest[0])],
        contact=af.Contact(itself=True),
    )
    assert without.solve().report.contact.self_intersections is None


@pytest.mark.parametrize(("degrees", "steps"), [(35, 0), (50, 20)], ids=["in one go", "dragged"])
def test_parts_between_yielding_handles_are_not_squashed(degrees, steps):
    """Six boxes along one leg turn into the other leg, each held back in a way of its own."""
    samples = af.sample_surface(trousers(), 6000, seed=0)
    rest = [box([0, 0, 1.1], [0.3] * 3), box([-LEG, 0, FOOT], [0.1] * 3)]
    rest += [box([LEG, 0, height], [0.15, 0.15, 0.08]) for height in np.linspace(0.05, 0.6, 6)]
    hip = turned(0, shift=(LEG, 0, HIP))

    def pose(share):
        turn = hip @ turned(share * degrees) @ np.linalg.inv(hip)
        return rest[:2] + [turn @ there for there in rest[2:]]

    contact = af.Contact(itself=True)
    if steps:
        live = af.LiveDeformer(samples, [af.Cuboid(m, m) for m in rest], contact=contact)
        for k in range(1, steps + 1):
            live.follow(pose(k / steps))
        report = live.solve(iterations=60).report
    else:
        handles = [af.Cuboid(m, to) for m, to in zip(rest, pose(1.0), strict=True)]
        report = af.deform(samples, handles, af.DeformOptions(centers=400), contact=contact).report
    assert report.flipped_share == 0
    assert report.energy < KEEPS_ITS_SHAPE


def test_a_paw_whose_target_lies_in_the_head_is_held_back_by_the_neck():
    """The way there leads through the neck, which it pressed flat."""
    samples = af.sample_surface(contact_cases.BODIES["beast"], 6000, seed=0)
    places = [
        ((0, 0, 0.5), 0.16),
        ((0.65, 0, 0.68), 0.1),
        ((-0.42, 0.1, 0.06), 0.08),
        ((0.42, 0.1, 0.06), 0.08),
    ]
    rest = [box(place, [size] * 3) for place, size in places]
    motion = turn([-0.47, -0.89, -0.03], 137.5, (0.4, 0.1, 0.45))
    handles = [*(af.Cuboid(m, m) for m in rest[:3]), af.Cuboid(rest[3], motion @ rest[3])]
    options = af.DeformOptions(centers=400)
    report = af.deform(samples, handles, options, contact=af.Contact(itself=True)).report
    assert report.energy < NOT_FLAT
    assert 3 in [held.handle for held in report.contact.held]
