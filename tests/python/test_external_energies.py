# SPDX-License-Identifier: GPL-3.0-or-later
"""Energies written in Python."""

import numpy as np
import pytest
from support.geometry import cases
from support.geometry.meshes import sphere
from support.tolerances import ENERGY_IN_PYTHON

import arapfields as af

# Energies written in Python: that they join the loss with their derivatives, in the mesh's coordinates.


def settings(**changes):
    return dict(width=16, layers=2, iterations=60, batch=100, handle_batch=20) | changes


def samples_in_metres(count=600):
    """The bar, ten times as large and elsewhere: mesh coordinates are not the cube's."""
    unit = cases.bar_samples(count)
    return af.SurfaceSamples(10.0 * unit.points + [3, 0, -2], unit.normals)


def handles_in_metres(samples, lift=0.0):
    rest = np.diag([1.5, 3.0, 3.0, 1.0])
    rest[:3, 3] = [3 - 7.5, 0, -2]
    return [cases.moved(rest, cases.shift([0, 0, lift]))]


class Spring(af.Energy):
    """Half the mean squared distance of the values to where they would be, moved by an offset."""

    def __init__(self, offset, weight):
        self.offset, self.weight, self.seen = np.asarray(offset, float), weight, []

    def __call__(self, jets):
        self.seen.append(jets)
        off = jets.values - jets.points - self.offset
        return af.EnergyValue(self.weight / 2 * (off**2).sum(1).mean(), self.weight * off / len(off))


@pytest.mark.parametrize("kind", ["neural", "radial"])
@pytest.mark.parametrize("call", ["deform", "stylize"])
def test_a_pull_moves_the_surface_where_it_says(call, kind):
    samples = samples_in_metres()
    offset = np.array([0.0, 2.0, 0.0])
    mine = Spring(offset, 1000.0)
    steps = settings(field=kind, iterations=250)
    if call == "deform":
        held = handles_in_metres(samples)
        field = af.deform(samples, held, af.DeformOptions(handle_weight=1e-6, **steps), energies=[mine])
    else:
        field = af.stylize(samples, "cube", af.StylizeOptions(strength=0.0, **steps), energies=[mine])
    moved = field(samples.points) - samples.points
    assert np.abs(moved - offset).mean() < 0.15


class Stretch(af.Energy):
    """‖J − R‖², as the library has it, by a singular value decomposition."""

    def __init__(self, weight):
        self.weight = weight

    def __call__(self, jets):
        u, _, vt = np.linalg.svd(jets.jacobians)
        sign = np.sign(np.linalg.det(u @ vt))
        u[:, :, 2] *= sign[:, None]
        off = jets.jacobians - u @ vt
        n = len(off)
        return af.EnergyValue(self.weight * (off**2).sum() / n, jacobians=2 * self.weight * off / n)


@pytest.mark.parametrize("kind", ["neural", "radial"])
def test_stretch_in_python_equals_more_rigidity(kind):
    """Half of the stretch is ours, half is the library's: a solve with rigidity 2 is the same one."""
    vertices, triangles = sphere(10.0, 3)
    samples = af.sample_mesh(vertices + np.array([3, 0, -2]), triangles, 600)
    calls = {"own": [], "ours": []}
    styled = dict(field=kind, strength=1.0, barrier=0.0, bending=0.0, **{k: v for k, v in settings().items()})
    styled["iterations"] = 15 if kind == "neural" else 100
    for key, rigidity, energies in [("own", 1.0, [Stretch(1.0)]), ("ours", 2.0, [])]:
        options = af.StylizeOptions(rigidity=rigidity, **styled)
        af.stylize(samples, "cube", options, energies=energies, callback=calls[key].append)
    if kind == "neural":
        losses = [[record.loss for record in calls[key]] for key in calls]
        assert losses[0] == pytest.approx(losses[1], rel=ENERGY_IN_PYTHON)
        for record in calls["own"]:
            assert record.terms["energies[0]"] == pytest.approx(
                record.terms["stretch"], rel=ENERGY_IN_PYTHON, abs=1e-9
            )
    else:  # the preconditioner differs: the same minimum by another way
        assert calls["own"][-1].loss == pytest.approx(calls["ours"][-1].loss, rel=0.05)


class Curvature(af.Energy):
    """Mean squared second derivatives, in mesh units."""

    order = 2

    def __init__(self, weight):
        self.weight = weight

    def __call__(self, jets):
        n = len(jets.points)
        return af.EnergyValue(
            self.weight * (jets.hessians**2).sum() / n, hessians=2 * self.weight * jets.hessians / n
        )


def test_second_derivatives_are_given_on_request():
    samples = cases.bar_samples()
    held = cases.bar_handles()
    soft, stiff = (
        af.deform(samples, held, af.DeformOptions(bending=0.0, **settings(iterations=200)), energies=e)
        for e in ([], [Curvature(0.1)])
    )
    points = samples.points[:300]
    curvature = [np.square(f.hessian(points)).sum(axis=(1, 2, 3)).mean() for f in (soft, stiff)]
    assert curvature[1] < 0.5 * curvature[0]


class Everything(af.Energy):
    """A smooth function of every number of the jets, with coefficients drawn once."""

    order = 2

    def __init__(self, count, seed=0):
        rng = np.random.default_rng(seed)
        self.a, self.b = rng.normal(size=(count, 3)), rng.normal(size=(count, 3, 3))
        self.c = rng.normal(size=(count, 3, 3, 3))

    def __call__(self, jets):
        parts = [(self.a, jets.values), (self.b, jets.jacobians), (self.c, jets.hessians)]
        value = sum((weight * np.sin(x)).sum() for weight, x in parts)
        return af.EnergyValue(value, *[weight * np.cos(x) for weight, x in parts])


@pytest.mark.parametrize("composed", [False, True])
def test_the_parameter_gradient_is_that_of_differences(composed):
    """Every kind of derivative, through the frame's scale and the network's pull-back."""
    from arapfields._native import testing

    samples = samples_in_metres(20)
    probe = testing.LossProbe(samples, [], energies=[Everything(20)])
    rng = np.random.default_rng(1)
    x, direction = 0.3 * rng.normal(size=(2, probe.size))
    if composed:
        with_path = testing.DevicePath()
    loss, gradient = probe(x, 3)
    step = 1e-6
    slope = (probe(x + step * direction, 3)[0] - probe(x - step * direction, 3)[0]) / (2 * step)
    if composed:
        del with_path
    assert gradient @ direction == pytest.approx(slope, rel=1e-6)
    assert np.isfinite(loss)


def test_an_energy_receives_mesh_coordinates():
    samples = samples_in_metres()
    mine = Spring([0, 0, 0], 0.0)
    af.deform(
        samples, handles_in_metres(samples), af.DeformOptions(**settings(iterations=1)), energies=[mine]
    )
    jets = mine.seen[0]
    n = len(jets.points)
    assert n == 100 and jets.values.shape == (n, 3) and jets.jacobians.shape == (n, 3, 3)
    near = np.abs(samples.points[:, None] - jets.points[None]).max(2).min(0)
    assert near.max() < 1e-9
    assert np.abs(jets.values - jets.points).max() < 1e-4  # the start is the identity
    assert np.abs(jets.jacobians - np.eye(3)).max() < 1e-4
    with pytest.raises(af.InvalidInput, match="hessians"):
        jets.hessians  # noqa: B018


def test_a_plain_function_and_a_plain_tuple_do():
    samples = cases.bar_samples(200)
    calls = []

    def nothing(jets):
        calls.append(len(jets.points))
        return (0.0,)

    options = af.DeformOptions(**settings(iterations=5))
    points = samples.points[:20]
    with_it = af.deform(samples, cases.bar_handles(), options, energies=[nothing])
    assert len(calls) == 5
    assert np.array_equal(with_it(points), af.deform(samples, cases.bar_handles(), options)(points))


class Mine(Exception):
    pass


@pytest.mark.parametrize("kind", ["neural", "radial"])
def test_errors_of_an_energy_reach_the_caller(kind):
    error = Mine("in the energy")

    def fails(jets):
        raise error

    with pytest.raises(Mine) as caught:
        options = af.DeformOptions(**settings(field=kind))
        af.deform(cases.bar_samples(200), cases.bar_handles(), options, energies=[fails])
    assert caught.value is error


def test_style_and_energy_together():
    samples = af.sample_mesh(*sphere(1.0, 2), 400)
    calls = []
    options = af.StylizeOptions(**settings(iterations=5))
    af.stylize(samples, "cube", options, energies=[Spring([0, 0, 0], 1.0)], callback=calls.append)
    assert {"style", "energies[0]"} <= set(calls[0].terms)


# Energies written in Python: what does not fit is named.


def n(jets):
    return len(jets.points)


@pytest.mark.parametrize(
    "returned, word",
    [
        (lambda j: 1.0, "float"),
        (lambda j: None, "NoneType"),
        (lambda j: (), "tuple of 0"),
        (lambda j: (np.zeros(3),), "3 numbers"),
        (lambda j: ("x",), "value"),
        (lambda j: (np.nan,), "NaN"),
        (lambda j: (1.0, np.zeros((n(j), 2))), r"values: shape \(\d+, 2\).*\(\d+, 3\)"),
        (lambda j: (1.0, None, np.zeros((n(j), 3))), "jacobians: shape"),
        (lambda j: (1.0, None, None, np.zeros((n(j), 3, 3, 3))), "order is 1"),
        (lambda j: (1.0, np.full((n(j), 3), np.inf)), "derivatives are NaN or infinite"),
    ],
)
def test_bad_results_of_an_energy_are_named(returned, word):
    def good(jets):
        return af.EnergyValue(0.0)

    options = af.DeformOptions(**settings())
    with pytest.raises(af.InvalidInput, match=rf"^energies\[1\].*{word}"):
        af.deform(cases.bar_samples(200), cases.bar_handles(), options, energies=[good, returned])


@pytest.mark.parametrize(
    "wrong, word", [(5, "energies: .*int"), ([5], r"energies\[0\]: .*int"), ([af.Energy], r"energies\[0\]")]
)
def test_objects_that_are_no_energy_are_refused(wrong, word):
    with pytest.raises(af.InvalidInput, match=word):
        af.deform(cases.bar_samples(50), cases.bar_handles(), energies=wrong)


def test_an_unknown_order_is_refused():
    def mine(jets):
        return af.EnergyValue(0.0)

    mine.order = 3
    with pytest.raises(af.InvalidInput, match=r"energies\[0\]\.order: 3"):
        af.deform(cases.bar_samples(50), cases.bar_handles(), energies=[mine])


def test_an_energy_that_runs_away_is_a_divergence():
    def infinite(jets):
        return (np.inf,)

    with pytest.raises(af.Diverged):
        options = af.DeformOptions(**settings())
        af.deform(cases.bar_samples(50), cases.bar_handles(), options, energies=[infinite])
