# SPDX-License-Identifier: GPL-3.0-or-later
"""A style's strength is even: a share of it moves a figure by that share of the way, finished or not."""

import sys
from pathlib import Path

import numpy as np
import pytest
from support.geometry.meshes import box, subdivide, suzanne, torus

import arapfields as af

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "blender_scripts"))
import creatures

EVEN = 0.1  # of the share: single triangles that fold on the way are opened
ROUNDED, SINGLE = 1e-6, 1e-4  # of a size of about 1
WEIGHT_GROWTH = 80.0  # of a cube's weight between strengths of almost nothing and 1
FEW = {"centers": 200, "iterations": 20}
UP = [0, 0, 1]


def figure(name):
    if name == "suzanne":
        return subdivide(*suzanne())
    if name == "torus":
        return torus()
    shape = creatures.load(name)
    return shape.vertices.astype(float), shape.triangles


@pytest.mark.parametrize("style", ["cube", "octahedron"])
@pytest.mark.parametrize("name", ["dog", "dinosaur", "lizard", "suzanne", "torus"])
def test_a_share_of_the_strength_goes_that_share_of_the_way(name, style):
    """And no triangle folds on it that the whole does not fold."""
    rest, triangles = figure(name)
    samples = af.sample_mesh(rest, triangles, count=4000, seed=0)

    def finished(strength):
        moved = af.stylize(samples, style, af.StylizeOptions(strength=strength, **FEW))(rest)
        return af.sharpen(rest, triangles, moved, style, af.SharpenOptions(strength=strength), up=UP)

    def way(shape):
        return np.linalg.norm(shape - rest, axis=1).mean()

    whole = finished(1.0)
    folded = len(af.folded_triangles(rest, triangles, whole))
    for share in (0.25, 0.5, 0.75):
        part = finished(share)
        assert way(part) / way(whole) == pytest.approx(share, rel=EVEN)
        assert len(af.folded_triangles(rest, triangles, part)) <= folded


@pytest.mark.parametrize("style", ["cube", "object"])
def test_a_field_and_a_finish_go_a_share_of_the_way(style):
    """The whole solve is the same, and what is shown is a part of its way: in live mode as well."""
    rest, triangles = torus()
    samples = af.sample_mesh(rest, triangles, count=2000, seed=0)
    normals = style if style == "cube" else af.ObjectStyle(*box((1.0, 1.0, 1.0)))
    options = {share: af.StylizeOptions(strength=share, **FEW) for share in (0.3, 1.0)}
    part, whole = (af.stylize(samples, normals, options[share])(rest) for share in (0.3, 1.0))
    assert np.abs(part - rest - 0.3 * (whole - rest)).max() < ROUNDED
    assert np.abs(whole - rest).max() > 0.02
    sharpened, most = (
        af.sharpen(rest, triangles, moved, normals, af.SharpenOptions(strength=share))
        for share, moved in ((0.3, part), (1.0, whole))
    )
    assert np.abs(sharpened - rest - 0.3 * (most - rest)).max() < ROUNDED
    assert np.abs(most - whole).max() > 0.01
    live = af.LiveDeformer(samples)
    live.track(rest, triangles=triangles)
    shown = {}
    for share in (1.0, 0.3):
        live.set_style(normals, share)
        if share == 1.0:
            live.follow(iterations=100)
        shown[share] = live.tracked().astype(float)
    assert np.abs(shown[0.3] - rest - 0.3 * (shown[1.0] - rest)).max() < SINGLE
    live.follow(iterations=3)
    assert np.abs(live.field(rest) - rest - 0.3 * (shown[1.0] - rest)).max() < 0.01
    assert live.report.preference < live.field.report.preference + 1e-9


@pytest.mark.parametrize("how", ["handles", "ground"])
def test_where_more_than_the_style_moves_a_surface_strength_is_its_weight(how):
    """At strength 0 the rest of what moves it is left; at small ones the shape is near to that."""
    rest, triangles = torus()
    samples = af.sample_mesh(rest, triangles, count=2000, seed=0)
    further, strengths = {}, (0.0, 0.02, 1.0)
    if how == "handles":
        pins = [rest[np.argmax(rest[:, 0])], rest[np.argmin(rest[:, 0])]]
        further["handles"] = [
            af.PointHandle(pin, pin + shift)
            for pin, shift in zip(pins, ([0.3, 0, 0], [0, 0, 0]), strict=True)
        ]
    else:
        further["contact"] = af.Contact(ground=rest[:, 2].min() - 0.005)
    shapes = [
        af.stylize(samples, "octahedron", af.StylizeOptions(strength=share, **FEW), **further)(rest)
        for share in strengths
    ]
    near, far = (np.linalg.norm(shapes[0] - shape, axis=1).mean() for shape in shapes[1:])
    assert near < 0.3 * far
    if how == "handles":
        assert all(np.abs(shape - rest).max() > 0.2 for shape in shapes)


def test_told_that_more_has_moved_the_vertices_a_finish_takes_strength_for_its_weight():
    rest, triangles = torus()
    options = af.SharpenOptions(strength=0.5)
    weight = options.style_weight * (WEIGHT_GROWTH**0.5 - 1) / (WEIGHT_GROWTH - 1)
    of_weight = af.sharpen(rest, triangles, rest, "cube", af.SharpenOptions(style_weight=weight))
    posed = af.sharpen(rest, triangles, rest, "cube", options, alone=False)
    assert np.abs(posed - of_weight).max() < ROUNDED
    assert np.abs(af.sharpen(rest, triangles, rest, "cube", options) - of_weight).max() > 0.01
