# SPDX-License-Identifier: GPL-3.0-or-later
"""Stiffness: weights of single samples, samples of several meshes, and λ in the shape's own measure."""

import numpy as np
import pytest
from support.geometry import cases, meshes
from support.geometry.cases import box, moved, turn
from support.geometry.meshes import LEFT, RIGHT, sphere, subdivide, turned
from support.geometry.meshes import box as box_mesh

import arapfields as af
from arapfields._native import testing

# Samples of several meshes, and weights of single samples in every solve.

SMALL = {"samples": 800, "coarse_centers": 30, "fine_centers": 120}
NETWORK = {"field": "neural", "width": 32, "layers": 2, "iterations": 40, "batch": 100}


def bar_mesh():
    mesh = box_mesh((2.0, 0.5, 0.5))
    for _ in range(3):
        mesh = subdivide(*mesh)
    return mesh


@pytest.fixture(scope="module")
def samples():
    return af.sample_mesh(*bar_mesh(), 2000, seed=1)


def bend(degrees=60):
    return [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, turned(degrees) @ RIGHT)]


def stretch_of(field, points):
    """Mean length by which the singular values of J miss 1."""
    return np.abs(np.linalg.svd(field.jacobian(points), compute_uv=False) - 1).mean()


def test_samples_of_several_meshes_split_by_area():
    (V, F), (W, G) = bar_mesh(), sphere(0.5)
    both = af.sample_meshes([(V, F), (W + np.array([5, 0, 0]), G)], 8000, seed=3)
    assert both.frame == af.sample_mesh(V, F, 10).frame
    on_ball = both.mesh_indices == 1
    assert (np.abs(np.linalg.norm(both.points - [5, 0, 0], axis=1) - 0.5)[on_ball] < 0.02).all()
    area = 4 * np.pi * 0.25
    share = area / (area + 18)  # the bar's faces: 4 · 4 + 2
    assert on_ball.mean() == pytest.approx(share, abs=4 * np.sqrt(share / 8000))  # four deviations
    alone = af.sample_meshes([(V, F)], 500, seed=3)
    assert np.array_equal(alone.points, af.sample_mesh(V, F, 500, seed=3).points)
    assert not alone.mesh_indices.any()


def test_a_sleeve_bends_with_the_arm_it_is_sampled_with():
    V, F = bar_mesh()
    sleeve = box_mesh((0.6, 0.55, 0.55))
    together = af.sample_meshes([(V, F), sleeve], 4000)
    field = af.deform(together, bend())
    assert field.report.flipped_share == 0
    assert stretch_of(field, together.points[together.mesh_indices == 1]) < 0.2


def test_vertex_weights_are_interpolated():
    V, F = bar_mesh()
    samples = af.sample_mesh(V, F, 2000, weights=1 + np.abs(V[:, 0]), bend_weights=2 * np.ones(len(V)))
    assert np.allclose(samples.weights, 1 + np.abs(samples.points[:, 0]))
    assert np.allclose(samples.bend_weights, 2)
    both = af.sample_meshes([(V, F), (V + np.array([9, 0, 0]), F)], 2000, weights=[None, 5 * np.ones(len(V))])
    assert np.allclose(both.weights, np.where(both.mesh_indices == 1, 5, 1))
    assert np.allclose(both.bend_weights, 1)


def every_solve(samples):
    live = af.LiveDeformer(samples, bend(), af.LiveOptions(**SMALL))
    yield af.deform(samples, bend(), af.DeformOptions(centers=200))
    yield af.deform(samples, bend(), af.DeformOptions(**NETWORK))
    yield af.deform(samples, bend(), af.DeformOptions(fresh_samples=50, **NETWORK))
    yield live.solve(iterations=50)
    yield af.stylize(samples, "cube", af.StylizeOptions(iterations=5))


def test_weights_of_one_are_none_bit_for_bit(samples):
    ones = np.ones(len(samples))
    weighted = samples.with_weights(ones, ones)
    for plain, same in zip(every_solve(samples), every_solve(weighted), strict=True):
        assert np.array_equal(plain(samples.points), same(samples.points))
        assert plain.report.energy == same.report.energy


@pytest.mark.parametrize("kind", ["radial", "live", "painted live"])
def test_a_stiff_group_does_not_stretch(samples, kind):
    """Stiffness × 1000 on the bar's middle, while its left and right give way: stretch ≤ 0.1 %."""
    middle = np.abs(samples.points[:, 0]) < 0.5
    weights = np.where(middle, 1000.0, 1.0)
    stiff = samples.with_weights(weights)
    if kind == "radial":
        field, plain = af.deform(stiff, bend()), af.deform(samples, bend())
    else:
        live = af.LiveDeformer(samples if "painted" in kind else stiff, bend())
        if "painted" in kind:
            live.solve()
            live.set_weights(weights)
        field = live.solve(iterations=100, tolerance=1e-6)
        plain = af.LiveDeformer(samples, bend()).solve(iterations=100, tolerance=1e-6)
    inside = samples.points[np.abs(samples.points[:, 0]) < 0.45]
    assert stretch_of(field, inside) <= 1e-3
    assert stretch_of(field, inside) < 0.1 * stretch_of(plain, inside)


def test_a_stiff_group_does_not_stretch_in_a_network(samples):
    """A hundred times: stiffer than that a short training does not follow."""
    weights = np.where(np.abs(samples.points[:, 0]) < 0.5, 100.0, 1.0)
    inside = samples.points[np.abs(samples.points[:, 0]) < 0.45]
    options = af.DeformOptions(field="neural", width=64, layers=3, iterations=200)
    field, plain = (af.deform(s, bend(), options) for s in (samples.with_weights(weights), samples))
    assert stretch_of(field, inside) < 0.4 * stretch_of(plain, inside)


def test_bend_weights_move_the_bend(samples):
    """The left half a hundred times as stiff against bending: the right half bends more sharply."""
    left = samples.points[:, 0] < 0
    field = af.deform(samples.with_weights(None, np.where(left, 100.0, 1.0)), bend())
    plain = af.deform(samples, bend())

    def bent(f, side):
        return af.arap_energy(f, samples.points[side & (np.abs(samples.points[:, 0]) < 1.4)])[1]

    assert bent(field, left) < 0.5 * bent(plain, left)
    assert bent(field, ~left) > bent(plain, ~left)


def test_terms_that_are_told_have_their_weights(samples):
    calls = []
    stiff = samples.with_weights(np.where(samples.points[:, 0] > 0, 10.0, 1.0))
    af.deform(stiff, bend(), af.DeformOptions(centers=200), callback=calls.append)
    last = calls[-1]
    assert sum(last.terms.values()) == pytest.approx(last.loss, rel=1e-9)
    assert all(value >= 0 for value in last.terms.values())


def test_weights_that_do_not_fit_are_refused(samples):
    for weights in (
        np.ones(7),
        -np.ones(len(samples)),
        np.full(len(samples), np.nan),
        np.zeros(len(samples)),
    ):
        with pytest.raises(af.InvalidInput, match="weights"):
            samples.with_weights(weights)
    with pytest.raises(af.InvalidInput, match="bend_weights"):
        samples.with_weights(None, np.ones(7))
    live = af.LiveDeformer(samples, bend(), af.LiveOptions(**SMALL))
    with pytest.raises(af.InvalidInput, match="weights"):
        live.set_weights(np.ones(7))
    live.solve()  # nothing is lost
    V, F = bar_mesh()
    with pytest.raises(af.InvalidInput, match=r"meshes\[1\].*vertices"):
        af.sample_meshes([(V, F), (V * np.nan, F)])
    with pytest.raises(af.InvalidInput, match=r"meshes\[1\]"):
        af.sample_meshes([(V, F), V])
    with pytest.raises(af.InvalidInput, match="meshes"):
        af.sample_meshes([])
    with pytest.raises(af.InvalidInput, match=r"meshes\[1\].weights"):
        af.sample_meshes([(V, F), (V, F)], weights=[None, np.ones(3)])
    with pytest.raises(af.InvalidInput, match="weights"):
        af.sample_mesh(V, F, weights=np.ones(3))


def scaled(center, factors):
    matrix = np.diag([*factors, 1.0])
    matrix[:3, 3] = center - matrix[:3, :3] @ center
    return matrix


@pytest.mark.parametrize("factors", [(1.5, 1.5, 1.5), (1.0, 2.0, 0.7)])
@pytest.mark.parametrize("kind", ["radial", "exact", "live", "neural"])
def test_handles_scale_when_asked(samples, factors, kind):
    target = scaled(np.array([1.8, 0, 0]), factors) @ RIGHT
    handles = [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, target, allow_scale=True)]
    if kind == "live":
        field = af.LiveDeformer(samples, handles).solve(iterations=100, tolerance=1e-6)
    else:
        options = {"neural": {"field": "neural", "iterations": 200, "width": 64, "layers": 3}}.get(kind, {})
        field = af.deform(samples, handles, af.DeformOptions(exact_handles=kind == "exact", **options))
    held = samples.points[(samples.points[:, 0] > 1.55)]
    motion = target @ np.linalg.inv(RIGHT)
    off = np.linalg.norm(field(held) - held @ motion[:3, :3].T - motion[:3, 3], axis=1)
    asked = np.linalg.norm(held @ motion[:3, :3].T + motion[:3, 3] - held, axis=1)
    allowed = {"exact": 1e-5, "neural": 0.3}.get(kind, 0.1)  # of the way that is asked for
    assert off.mean() < allowed * asked.mean()


def test_handles_do_not_scale_unasked(samples):
    target = scaled(np.zeros(3), (1.5, 1.5, 1.5)) @ RIGHT
    with pytest.raises(af.InvalidInput, match="allow_scale"):
        af.Cuboid(RIGHT, target)
    for bad in ((-1, 1, 1), (1, 0, 1)):
        with pytest.raises(af.InvalidInput, match=r"mirrors|flat"):
            af.Cuboid(RIGHT, scaled(np.zeros(3), bad) @ RIGHT, allow_scale=True)
    live = af.LiveDeformer(samples, bend(), af.LiveOptions(**SMALL))
    with pytest.raises(af.InvalidInput, match=r"targets|scales"):
        live.solve([LEFT, target])
    region = af.Region(np.flatnonzero(samples.points[:, 0] > 1.5), RIGHT, target, allow_scale=True)
    assert region.allow_scale and np.allclose(region.motion, target @ np.linalg.inv(RIGHT))
    assert not moved(box([-1, -1, -1], [1, 1, 1]), turn([0, 0, 1], 30)).allow_scale


# Stiffness in the shape's own measure: the local thickness, and λ that follows it.

REACH = 0.345  # λ = (REACH t)²
# Radii are those of balls between 1,500 nodes and 6,000 witnesses, evened out over neighbours.
SAMPLED = 0.12


def samples_of(vertices, triangles, count=12000):
    return af.sample_mesh(np.asarray(vertices, float), triangles, count=count)


def test_a_tube_is_as_thick_as_its_radius():
    v, f = meshes.torus()
    samples = samples_of(v, f)
    ring = np.hypot(samples.points[:, 0], samples.points[:, 1])
    middle = 0.5 * (ring.max() + ring.min())
    tube = np.hypot(ring - middle, samples.points[:, 2]).mean()
    assert np.allclose(testing.thickness(samples), tube, rtol=SAMPLED)


@pytest.mark.parametrize("share", [0.05, 0.02])
def test_a_plate_is_half_as_thick_as_its_sides_are_apart(share):
    """Also one that is thinner than samples are apart."""
    v, f = meshes.box((1.0, 1.0, share))
    thickness = testing.thickness(samples_of(v, f))
    assert np.abs(np.median(thickness) / share - 1) < SAMPLED


def test_an_open_sheet_is_as_thick_as_leather_of_its_size():
    """Nothing bounds a ball below it: 0.03 of the square root of its area."""
    v, f = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    thickness = testing.thickness(samples_of(v, f))
    assert np.allclose(thickness, 0.03 * 2.0, rtol=1e-9)


def test_parts_have_their_own_thickness():
    """A ball with a thin square rod: each is as thick as if it were alone, the rod less at its edges."""
    v, f = meshes.sphere()
    rod, g = meshes.box((2.0, 0.1, 0.1))
    both = np.concatenate([v, rod + np.array([2.9, 0, 0])])
    samples = samples_of(both, np.concatenate([f, g + len(v)]), 20000)
    thickness = testing.thickness(samples)
    out = samples.points[:, 0] > 1.6
    assert 0.07 < np.median(thickness[out]) < 0.1 * (1 + SAMPLED)
    assert np.median(thickness[samples.points[:, 0] < 0.5]) > 0.5


def test_bending_is_the_square_of_thickness_in_the_cube():
    v, f = meshes.torus()
    samples = samples_of(v, f)
    expected = (REACH * testing.thickness(samples) / samples.frame.scale) ** 2
    assert np.allclose(testing.bending(samples, af.DeformOptions()), expected)
    assert np.allclose(testing.bending(samples, af.DeformOptions(bending=2.5)), 2.5 * expected)
    paper = af.DeformOptions(bending_unit="cube")
    assert np.allclose(testing.bending(samples, paper), 0.01)


def test_thickness_turns_and_scales_with_the_shape():
    """To rounding: the samples that it is measured at are chosen along the shape's own axes."""
    v, f = meshes.box((2.0, 1.0, 0.5))
    v = v + 0.3 * np.sin(3 * v[:, [1, 2, 0]])  # no symmetry
    motion = cases.turn([1, 2, 3], 37, (1.0, 0, 0))
    turned = 50.0 * (v @ motion[:3, :3].T + motion[:3, 3])
    rest, after = testing.thickness(samples_of(v, f)), testing.thickness(samples_of(turned, f))
    assert np.allclose(after, 50.0 * rest, rtol=1e-6)
    mirrored = testing.thickness(samples_of(v * [-1.0, 1, 1], f[:, ::-1]))
    assert abs(np.median(mirrored) / np.median(rest) - 1) < SAMPLED  # other samples: corners change places


def test_reports_contain_the_minimised_energy():
    """Its unit: none. With the same λ everywhere it is stretch + λ·bend."""
    samples = cases.bar_samples(2000)
    options = dict(field="radial", centers=100, bending_unit="cube", bending=3.0)
    report = af.deform(samples, cases.bar_handles(), af.DeformOptions(**options)).report
    assert np.isclose(report["energy"], report["stretch"] + 0.03 * report["bend"], rtol=1e-9)
    handles = cases.bar_handles()
    live = af.LiveDeformer(samples, handles, af.LiveOptions(bending_unit="cube", bending=3.0))
    live.solve([handle.target for handle in handles])
    assert np.isclose(live.report["energy"], live.report["stretch"] + 0.03 * live.report["bend"], rtol=1e-5)


@pytest.mark.parametrize("composed", [False, True])
def test_factors_of_points(composed):
    """The energy of points with factors is the mean of theirs, and so are its cotangents."""
    rng = np.random.default_rng(0)
    jets = rng.normal(size=(10, 40, 3))
    jets[1:4] += np.eye(3)[:, None]
    weights, bending = rng.uniform(0.1, 2, size=40), rng.uniform(0, 3, size=40)
    energy, cotangents = testing.arap_energy_by_points(jets, 0.7, weights, bending, composed=composed)
    total = 0.0
    for i in range(40):
        one = np.ascontiguousarray(jets[:, i : i + 1])
        stretch, bend, own = testing.arap_energy(one, 0.7 * bending[i], weights[i] / 40)
        total += weights[i] / 40 * (stretch + 0.7 * bending[i] * bend)
        assert np.allclose(cotangents[:, i : i + 1], own, atol=1e-12)
    assert np.isclose(energy, total, rtol=1e-12)
