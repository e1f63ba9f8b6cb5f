# SPDX-License-Identifier: GPL-3.0-or-later
"""Thin plates and open sheets bend as leather does: they keep their lengths, and follow the handles."""

import functools

import numpy as np
import pytest
from support.geometry import cases, meshes, sheets

import arapfields as af

LENGTHS = (0.9, 1.1)  # of an edge after and before,
KEPT = 0.98  # for so many of the edges
OFF = 0.01  # of a handle's samples in the mean, in sizes


def leaf():
    """An elliptic leaf, hollow along its middle, without thickness, on a stem of radius .02."""
    v, f = sheets.open_sheet(1.2, 0.7, 40, 24)
    v[:, 1] *= np.sqrt(np.clip(1 - (v[:, 0] / 0.62) ** 2, 0, 1))
    v[:, 0] += 0.55
    v[:, 2] = 0.1 * v[:, 1] ** 2
    stem, g = meshes.box((0.5, 0.02, 0.02))
    for _ in range(4):
        stem, g = meshes.subdivide(stem, g)
    return sheets.together((v, f), (stem - np.array([0.5, 0, 0.02]), g))


def ear():
    """A ball with an ear on top that is .01 thick, along x."""
    v, f = sheets.plate(1.1, 0.6, 0.01, 44, 24)
    v[:, 1] *= np.sqrt(np.clip(1 - ((v[:, 0] + 0.1) / 0.72) ** 2, 0.02, 1))
    return sheets.together(meshes.sphere(), (v + np.array([1.35, 0, 0]), f))


SCENES = {
    "plate .02": (lambda: sheets.plate(2, 2, 0.02), sheets.ends(-0.8, 0.8, sheets.arc(-0.8, 0.8, 100))),
    "plate .005": (lambda: sheets.plate(2, 2, 0.005), sheets.ends(-0.8, 0.8, sheets.arc(-0.8, 0.8, 100))),
    "turned plate": (lambda: sheets.plate(2, 2, 0.01), sheets.ends(-0.8, 0.8, cases.turn([0, 1, 0], -90))),
    "sheet": (lambda: sheets.open_sheet(2, 2), sheets.ends(-0.8, 0.8, sheets.arc(-0.8, 0.8, 120))),
    "hair card": (
        lambda: sheets.open_sheet(4, 0.4, 80, 8),
        sheets.ends(-1.7, 1.7, sheets.arc(-1.7, 1.7, 100) @ cases.turn([1, 0, 0], 90)),
    ),
    "leaf": (leaf, sheets.ends(-0.1, 0.95, sheets.arc(0.1, 0.95, 90))),
    "ear": (ear, sheets.ends(0.5, 1.7, sheets.arc(1.05, 1.7, 90))),
}


@functools.cache
def solved(name):
    mesh, handles = SCENES[name]
    v, f = mesh()
    return v, f, af.deform(af.sample_mesh(v, f), handles)


@pytest.mark.parametrize("name", SCENES)
def test_thin_shapes_keep_their_lengths_by_default(name):
    v, f, field = solved(name)
    ratios = sheets.edge_ratios(v, f, field.apply(v, triangles=f))
    ratios = ratios[np.isfinite(ratios)]  # a leaf's tips are points
    assert np.mean((ratios > LENGTHS[0]) & (ratios < LENGTHS[1])) > KEPT
    assert max(handle.error_mean for handle in field.report.handles) < OFF * np.ptp(v, axis=0).max()
