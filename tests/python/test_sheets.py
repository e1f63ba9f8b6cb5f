# SPDX-License-Identifier: GPL-3.0-or-later
"""Thin plates and open sheets bend as leather does: they keep their lengths, and follow the handles."""

import pickle

import numpy as np
import pytest
from support.geometry import cases, meshes

import arapfields as af
from arapfields._native import testing

LENGTHS = (0.9, 1.1)  # of an edge after and before,
KEPT = 0.98  # for so many of the edges
OFF = 0.01  # of a handle's samples in the mean, in sizes


def leaf():
    """An elliptic leaf, hollow along its middle, without thickness, on a stem of radius .02."""
    v, f = meshes.open_sheet(1.2, 0.7, 40, 24)
    v[:, 1] *= np.sqrt(np.clip(1 - (v[:, 0] / 0.62) ** 2, 0, 1))
    v[:, 0] += 0.55
    v[:, 2] = 0.1 * v[:, 1] ** 2
    stem, g = meshes.box((0.5, 0.02, 0.02))
    for _ in range(4):
        stem, g = meshes.subdivide(stem, g)
    return meshes.together((v, f), (stem - np.array([0.5, 0, 0.02]), g))


def ear():
    """A ball with an ear on top that is .01 thick, along x."""
    v, f = meshes.plate(1.1, 0.6, 0.01, 44, 24)
    v[:, 1] *= np.sqrt(np.clip(1 - ((v[:, 0] + 0.1) / 0.72) ** 2, 0.02, 1))
    return meshes.together(meshes.sphere(), (v + np.array([1.35, 0, 0]), f))


def folded_sheet(thickness, gap, length=1.9, width=1.6):
    """A sheet of this thickness in the shape of a U that opens along x, from x = -1: closed."""
    radius = 0.5 * (gap + thickness)
    across, around = 24, 160
    way = np.linspace(-1, 1, around + 1) * (length + 0.5 * np.pi * radius)
    angle = np.clip(way / radius, -np.pi / 2, np.pi / 2)
    straight = np.maximum(np.abs(way) - 0.5 * np.pi * radius, 0.0)
    v, f = meshes.plate(2, width, thickness, around, across)
    rows = np.tile(np.repeat(np.arange(around + 1), across + 1), 2)
    offset = radius + v[:, 2]
    x = straight[rows] - offset * np.cos(angle[rows]) - 1
    return np.stack([x, v[:, 1], offset * np.sin(angle[rows])], 1), f


SCENES = {
    "plate .02": (lambda: meshes.plate(2, 2, 0.02), meshes.ends(-0.8, 0.8, meshes.arc(-0.8, 0.8, 100))),
    "plate .005": (lambda: meshes.plate(2, 2, 0.005), meshes.ends(-0.8, 0.8, cases.turn([0, 1, 0], -90))),
    "sheet": (lambda: meshes.open_sheet(2, 2), meshes.ends(-0.8, 0.8, meshes.arc(-0.8, 0.8, 120))),
    "hair card": (
        lambda: meshes.open_sheet(4, 0.4, 80, 8),
        meshes.ends(-1.7, 1.7, meshes.arc(-1.7, 1.7, 100) @ cases.turn([1, 0, 0], 90)),
    ),
    "leaf": (leaf, meshes.ends(-0.1, 0.95, meshes.arc(0.1, 0.95, 90))),
    "ear": (ear, meshes.ends(0.5, 1.7, meshes.arc(1.05, 1.7, 90))),
}


def keeps_lengths(v, f, field):
    ratios = meshes.edge_ratios(v, f, field.apply(v, triangles=f))
    return np.mean((ratios > LENGTHS[0]) & (ratios < LENGTHS[1])) > KEPT


@pytest.mark.parametrize("name", SCENES)
def test_thin_shapes_keep_their_lengths_by_default(name):
    mesh, handles = SCENES[name]
    v, f = mesh()
    field = af.deform(af.sample_mesh(v, f), handles)
    assert keeps_lengths(v, f, field)
    assert max(handle.error_mean for handle in field.report.handles) < OFF * np.ptp(v, axis=0).max()


@pytest.mark.parametrize("name", ["plate .005", "sheet", "hair card"])
def test_thin_shapes_keep_their_lengths_in_live_mode(name):
    mesh, handles = SCENES[name]
    v, f = mesh()
    live = af.LiveDeformer(af.sample_mesh(v, f), handles)
    for _ in range(12):
        field = live.solve([handle.target for handle in handles])
    assert keeps_lengths(v, f, field)


def test_a_folded_sheet_opens():
    """Two leaves .01 thick with a gap of .03, joined along one side: one lies, the other turns."""
    v, f = folded_sheet(0.01, 0.03)
    leaf = meshes.FAR
    low, high = cases.box((-0.2, -leaf, -leaf), (leaf, leaf, 0)), cases.box((-0.2, -leaf, 0), (leaf,) * 3)
    turn = cases.turn([0, 1, 0], -50, (-1.0, 0, 0))
    field = af.deform(af.sample_mesh(v, f), [cases.moved(low), cases.moved(high, turn)])
    assert keeps_lengths(v, f, field)
    assert max(handle.error_mean for handle in field.report.handles) < OFF


@pytest.mark.parametrize("thickness", [0.02, 0.005])
def test_a_thin_plate_is_no_thicker_than_the_least(thickness):
    """0.02 of its radius of gyration, however few samples lie opposite each other."""
    v, f = meshes.plate(2, 2, thickness)
    found = testing.thickness(af.sample_mesh(v, f))
    assert np.quantile(found, 0.98) < 0.02 * np.sqrt(2 / 3) * 1.1


def test_a_sheet_beside_a_body_has_its_own_thickness():
    """A patch with a long boundary is a sheet; half a sphere, with a shorter one, is a body with a hole."""
    body = meshes.sphere()
    v, f = meshes.open_sheet(1.0, 1.0)
    samples = af.sample_mesh(*meshes.together(body, (v + np.array([0, 0, 1.4]), f)))
    on_sheet = samples.points[:, 2] > 1.2
    found = testing.thickness(samples)
    assert np.allclose(found[on_sheet], 0.03, rtol=1e-9)
    assert found[~on_sheet].min() > 0.3
    half = body[1][(body[0][body[1]][:, :, 2] > -1e-9).all(axis=1)]
    assert testing.thickness(af.sample_mesh(body[0], half)).min() > 0.2


def test_copied_samples_know_their_sheets():
    samples = af.sample_mesh(*meshes.open_sheet(2, 1))
    copy = pickle.loads(pickle.dumps(samples))
    assert np.array_equal(testing.thickness(copy), testing.thickness(samples))
