# SPDX-License-Identifier: GPL-3.0-or-later
"""Networks: values, jets, gradients of losses, steps of training, files, and fits of meshes."""

import functools
import os
import subprocess
import sys
import threading
import time
from itertools import pairwise

import numpy as np
import pytest
from support import tolerances
from support.geometry import cases
from support.geometry.meshes import small_layers, sphere
from support.oracles import Network
from support.tolerances import (
    AUTOGRAD,
    DIFFERENCES,
    EVENED,
    FIT_REPORT,
    FLOAT_JETS,
    PUBLISHED_GRADIENT,
    PUBLISHED_VALUE,
    SAME_VECTORS,
)

import arapfields as af
from arapfields._native import testing

# Networks: values, jets, gradients of losses, steps of training, files.

# NeuralSdf: published networks against PyTorch, its files, and what it refuses.

torch = pytest.importorskip("torch")


@pytest.fixture
def sdf():
    return af.NeuralSdf.from_layers(*small_layers())


@pytest.mark.parametrize("name", ["bunny", "cube", "hand", "spot", "whale", "frog"])
def test_published_networks_equal_torch(data_dir, name):
    path = data_dir / "neural_sdf" / f"{name}.pt"
    network = Network.published(path)
    sdf = af.NeuralSdf.from_layers(*network.layers)
    points = np.random.default_rng(4).uniform(-1, 1, (1000, 3))
    expected = network.jets(points, 1)[..., 0].detach().numpy()
    assert np.abs(sdf(points) - expected[0]).max() < PUBLISHED_VALUE
    assert np.abs(sdf.gradient(points).T - expected[1:]).max() < PUBLISHED_GRADIENT
    assert sdf.frame == af.Frame((0, 0, 0), 1)
    assert not hasattr(sdf, "report")


def test_outside_the_cube_the_distance_to_the_cube_is_added(sdf):
    inside = np.array([[1.0, 0.3, -1.0], [0.2, 1.0, 0.1]])
    beyond = inside + np.array([[3.0, 0.0, -4.0], [0.0, 0.5, 0.0]])
    np.testing.assert_allclose(sdf(beyond), sdf(inside) + np.array([5.0, 0.5]), atol=1e-6)
    step, axes = 1e-2, np.eye(3)
    far = np.array([[2.0, 0.3, -3.0]])
    slopes = [(sdf(far + step * e) - sdf(far - step * e))[0] / (2 * step) for e in axes]
    np.testing.assert_allclose(sdf.gradient(far)[0], slopes, atol=2e-3)


def test_saved_and_loaded_is_the_same_bit_for_bit(sdf, tmp_path):
    path = tmp_path / "shape.safetensors"
    sdf.save(path)
    again = af.NeuralSdf.load(str(path))
    points = np.random.default_rng(5).uniform(-1, 1, (200, 3))
    assert np.array_equal(sdf(points), again(points))
    assert again.frame == sdf.frame
    again.save(tmp_path / "again.safetensors")
    assert path.read_bytes()[:4] == (tmp_path / "again.safetensors").read_bytes()[:4]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["again.safetensors", "shape.safetensors"]


@functools.cache
def numbers_by(level):
    """(instruction set, numbers) of a process that was told to use this one, where it can."""
    code = (
        "import numpy as np, sys; sys.path.insert(0, 'tests')\n"
        "from arapfields import _native; from support.geometry.meshes import small_layers\n"
        "from arapfields._native import testing\n"
        "w, b = small_layers(width=37)\n"
        "x = np.random.default_rng(0).uniform(-1, 1, (100, 3)); c = np.cos(np.arange(1000))\n"
        "jets, gradient = testing.mlp_jets(w, b, 4, 1.0, 30.0, x, 2, c, False)\n"
        "print(_native.simd_level(), *jets.ravel(), *gradient)"
    )
    environment = {**os.environ, "ARAPFIELDS_SIMD": level}
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    command = [sys.executable, "-c", code]
    output = subprocess.run(command, env=environment, cwd=root, capture_output=True, text=True)
    assert output.returncode == 0, output.stderr
    used, *numbers = output.stdout.split()
    return used, np.array(numbers, float)


@pytest.mark.parametrize("level", ["neon", "avx2", "avx512"])
def test_kernels_for_every_instruction_set_agree(level):
    used, numbers = numbers_by(level)
    if used != level:
        pytest.skip(f"this processor has no {level}")
    baseline, reference = numbers_by("baseline")
    assert baseline == "baseline"
    assert np.abs(numbers - reference).max() < 1e-5 * np.abs(reference).max()


def test_layers_that_do_not_fit_are_refused():
    weights, biases = small_layers()
    make = af.NeuralSdf.from_layers
    for bad, word in [
        ((weights[:-1], biases[:-1]), "output"),
        ((weights, biases[:-1]), "biases"),
        ((weights[:1] + weights[2:], biases), "as many"),
        (([weights[0][:, :7], *weights[1:]], biases), r"weights\[0\]"),
        ((weights, [biases[0][:3], *biases[1:]]), r"biases\[0\]"),
        (([weights[0] * np.inf, *weights[1:]], biases), "finite"),
        ((["a", *weights[1:]], biases), r"weights\[0\]"),
    ]:
        with pytest.raises(af.InvalidInput, match=word):
            make(*bad)
    for options in ({"octaves": 0}, {"frequency": np.nan}, {"sharpness": -1.0}):
        with pytest.raises(af.InvalidInput):
            make(weights, biases, **options)
    with pytest.raises(af.InvalidInput, match="points"):
        make(weights, biases)([[0.0, np.nan, 0.0]])


def test_layers_are_arguments_of_from_layers(sdf):
    weights, biases, octaves, frequency, sharpness = sdf.layers
    again = af.NeuralSdf.from_layers(weights, biases, octaves, frequency, sharpness)
    points = np.random.default_rng(5).uniform(-1, 1, (100, 3))
    assert np.array_equal(again(points), sdf(points))
    assert [w.shape for w in weights] == [w.shape for w in small_layers()[0]]


# The network's jets and their pull-back against automatic differentiation and finite differences.


def random_network(seed, width=24, layers=3, octaves=3, frequency=1.3, sharpness=9.0, outputs=3):
    rng = np.random.default_rng(seed)
    sizes = [6 * octaves, *[width] * layers, outputs]
    weights = [rng.normal(size=(b, a)) / np.sqrt(a) for a, b in pairwise(sizes)]
    biases = [rng.normal(size=b) * 0.3 for b in sizes[1:]]
    return Network(weights, biases, octaves, frequency, sharpness)


def relative(a, b):
    return np.abs(a - b).max() / max(np.abs(b).max(), 1e-30)


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("width,layers,count", [(24, 3, 7), (5, 1, 1), (33, 4, 300)])
def test_jets_and_parameter_gradients_equal_autograd(order, width, layers, count):
    network = random_network(order, width, layers)
    rng = np.random.default_rng(1)
    points = rng.uniform(-1, 1, (count, 3))
    expected = network.jets(points, order)
    cotangents = rng.normal(size=expected.shape)
    jets, gradient = testing.mlp_jets(*network.layers, points, order, cotangents.ravel())
    assert relative(jets, expected.detach().numpy()) < AUTOGRAD
    (expected * torch.tensor(cotangents)).sum().backward()
    assert relative(gradient, network.flat_gradient()) < AUTOGRAD


def test_jets_equal_finite_differences():
    network, step = random_network(5), 1e-3
    points = np.random.default_rng(2).uniform(-1, 1, (20, 3))
    jets, _ = testing.mlp_jets(*network.layers, points, 2)

    def slope(k):
        """Central differences of eighth order along axis k of the jets of first order."""
        axis, weights = np.eye(3)[k] * step, [4 / 5, -1 / 5, 4 / 105, -1 / 280]
        ends = [testing.mlp_jets(*network.layers, points + i * axis, 1)[0] for i in range(-4, 5)]
        return sum(w * (ends[4 + i] - ends[4 - i]) for i, w in enumerate(weights, 1)) / step

    pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    for k in range(3):
        difference = slope(k)
        assert relative(jets[1 + k], difference[0]) < DIFFERENCES
        for column, (i, j) in enumerate(pairs):
            if k in (i, j):
                other = j if k == i else i
                assert relative(jets[4 + column], difference[1 + other]) < DIFFERENCES


@pytest.mark.parametrize("order", [0, 1, 2])
def test_single_precision_follows_double(order):
    network = random_network(7, width=64, layers=4, sharpness=30.0)
    points = np.random.default_rng(3).uniform(-1, 1, (500, 3)).astype(np.float32)
    expected, _ = testing.mlp_jets(*network.layers, points, order)
    jets, _ = testing.mlp_jets(*network.layers, points, order, None, False)
    for column, reference in zip(jets, expected, strict=True):
        assert relative(column, reference) < FLOAT_JETS


# Parameter gradients of whole losses, in float64, against differences along random directions.

STYLE = af.preferred_normals("cube")
TERMS = {
    "stretch and handles": {},
    "bend": dict(bending=0.05),
    "gauss": dict(bending=0.01, preferred=STYLE, gauss=2.0),
    "barrier": dict(barrier=3.0),
    "stance": dict(keep_stance=2.0),
    "exact handles": dict(bending=0.05, margin=0.4),
    "everything": dict(bending=0.01, preferred=STYLE, gauss=2.0, barrier=3.0, margin=0.4, keep_stance=2.0),
}


@pytest.mark.parametrize("terms", TERMS.values(), ids=TERMS.keys())
def test_gradient_against_differences(terms):
    samples = cases.bar_samples(60)
    probe = testing.LossProbe(samples, cases.bar_handles(30.0), **terms)
    rng = np.random.default_rng(3)
    parameters = rng.normal(size=probe.size) * 0.2
    gradient = probe(parameters, seed=5)[1]
    assert np.abs(gradient).max() > 1e-3
    weights = {1: 672, 2: -168, 3: 32, 4: -3}  # central differences of eighth order, over 840
    step = 5e-3
    for _ in range(4):
        direction = rng.normal(size=probe.size)
        direction /= np.linalg.norm(direction)
        slope = sum(
            weight
            * (
                probe(parameters + k * step * direction, 5)[0]
                - probe(parameters - k * step * direction, 5)[0]
            )
            for k, weight in weights.items()
        ) / (840 * step)
        assert slope == pytest.approx(gradient @ direction, rel=tolerances.LOSS_GRADIENT, abs=1e-8)


# Orthogonalised momentum: a step keeps the gradient's singular vectors and evens out its singular values.

RATE = 0.5


def spread_gradient(rng, rows, columns, smallest):
    """A matrix of Frobenius norm 1 with singular values from `smallest` up."""
    rank = min(rows, columns)
    u = np.linalg.qr(rng.normal(size=(rows, rank)))[0]
    v = np.linalg.qr(rng.normal(size=(columns, rank)))[0]
    values = np.geomspace(smallest, 1.0, rank)
    values[:-1] *= 0.9 / max(np.linalg.norm(values[:-1]), 0.9)
    values[-1] = np.sqrt(1 - (values[:-1] ** 2).sum())
    return (u * values) @ v.T, u, v


@pytest.mark.parametrize("width,layers", [(24, 2), (130, 3), (70, 2)])
def test_a_step_evens_out_the_singular_values(width, layers):
    rng = np.random.default_rng(width)
    sizes = [18, *[width] * layers, 3]
    weights = [rng.normal(size=(b, a)) for a, b in pairwise(sizes)]
    biases = [rng.normal(size=b) for b in sizes[1:]]
    gradients = [spread_gradient(rng, b, a, 0.08) for a, b in pairwise(sizes)]
    flat = np.concatenate([np.append(g[0], rng.normal(size=len(g[0]))) for g in gradients])
    after = testing.step_muon(weights, biases, 3, flat, RATE)
    for old, new, (gradient, u, v) in list(zip(weights, after, gradients, strict=True))[:-1]:
        rows, columns = old.shape
        step = (old - new) / (RATE * max(1.0, rows / columns) ** 0.5)
        gram = u.T @ step @ v
        values = np.diag(gram)
        # The step has the gradient's singular vectors alone:
        assert np.abs(gram - np.diag(values)).max() < SAME_VECTORS
        assert np.abs(step - u @ gram @ v.T).max() < SAME_VECTORS
        assert np.abs(values - 1).max() < EVENED
        given = np.linalg.svd(gradient, compute_uv=False)
        assert given[-1] < 0.1 * given[0] and given[-1] > 0.01


# Rounded matrix products: a solve that uses them ends where one in single precision does.

SETTINGS = dict(iterations=80, width=96, layers=3, batch=200, threads=1, device="cpu")


@pytest.mark.parametrize("extra", [{}, dict(exact_handles=True)], ids=str)
def test_a_solve_with_rounded_products_is_as_good(extra):
    """On average: after so few iterations one start ends higher, another lower, by a tenth or more."""
    samples, handles = cases.bar_samples(600), cases.bar_handles(40.0)

    def solved(precision, seed):
        options = af.DeformOptions(precision=precision, seed=seed, **SETTINGS, **extra)
        return af.deform(samples, handles, options)

    pairs = [[solved(precision, seed) for precision in ("float32", "bfloat16")] for seed in range(4)]
    (exact, rounded), again = pairs[0], solved("bfloat16", 0)
    places = [field(samples.points) for field in (exact, rounded, again)]
    assert np.abs(places[1] - places[0]).max() > 1e-6  # another arithmetic did run
    assert np.array_equal(places[1], places[2])
    ratios = [rounded.report.energy / exact.report.energy for exact, rounded in pairs]
    assert np.mean(ratios) < 1 + tolerances.ROUNDED_SOLVE
    for exact, rounded in pairs:
        assert rounded.report.handle_error_mean < exact.report.handle_error_mean + 1e-3


def test_stylize_takes_the_option_too():
    samples = cases.bar_samples(400)
    turned = af.preferred_normals("cube") @ cases.turn([1, 2, 0], 25)[:3, :3]
    exact, rounded = (
        af.stylize(samples, turned, af.StylizeOptions(precision=precision, **SETTINGS)).report
        for precision in ("float32", "bfloat16")
    )
    assert rounded["preference"] == pytest.approx(exact["preference"], abs=0.02)


def test_other_precisions_are_refused():
    with pytest.raises(af.InvalidInput, match=r"precision.*'half'.*bfloat16"):
        af.deform(cases.bar_samples(50), cases.bar_handles(), af.DeformOptions(precision="half"))


# Fitting a network to a mesh's signed distance.

QUICK = {
    "iterations": 60,
    "width": 64,
    "batch": 512,
    "near_points": 20000,
    "uniform_points": 5000,
    "threads": 2,
}


@pytest.fixture(scope="module")
def ball():
    vertices, triangles = sphere(radius=3.0)
    return vertices + np.array([5.0, 0.0, -2.0]), triangles


@pytest.fixture(scope="module")
def fitted(ball):
    return af.fit_sdf(*ball, af.FitOptions(**QUICK))


def test_the_report_tells_the_error_in_mesh_units(ball, fitted):
    report, vertices = fitted.report, ball[0]
    assert report.stopped_by == "iterations" and report.iterations == QUICK["iterations"]
    assert fitted.frame == af.sample_mesh(*ball, count=1).frame and report.scale == fitted.frame.scale
    rng = np.random.default_rng(0)
    spreads = np.where(np.arange(4000) % 2, 0.05, 0.01)[:, None] * fitted.frame.scale
    near = af.sample_mesh(*ball, count=4000, seed=9).points + rng.normal(size=(4000, 3)) * spreads
    error = np.abs(fitted(near) - af.signed_distance(*ball, near))
    assert error.mean() == pytest.approx(report.near_mean, rel=FIT_REPORT)
    anywhere = fitted.frame.to_mesh(rng.uniform(-1, 1, (4000, 3)))
    error = np.abs(fitted(anywhere) - af.signed_distance(*ball, anywhere))
    assert error.mean() == pytest.approx(report.volume_mean, rel=FIT_REPORT)
    assert report.near_mean < 0.01 * np.ptp(vertices) and report.near_mean < report.near_max


def test_the_sign_and_the_gradient_are_right(ball, fitted):
    directions = np.random.default_rng(1).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    centre = ball[0].mean(0)
    assert (fitted(centre + 2.5 * directions) < 0).all() and (fitted(centre + 3.5 * directions) > 0).all()
    slopes = fitted.gradient(centre + 3.0 * directions)
    assert (slopes * directions).sum(1).mean() > 0.9
    assert np.abs(np.linalg.norm(slopes, axis=1) - 1).mean() < 0.1


def test_same_seed_same_network_other_seed_another(ball, fitted):
    points = np.random.default_rng(2).uniform(-1, 1, (100, 3))
    assert np.array_equal(af.fit_sdf(*ball, af.FitOptions(**QUICK))(points), fitted(points))
    assert not np.array_equal(af.fit_sdf(*ball, af.FitOptions(**QUICK, seed=1))(points), fitted(points))


def test_it_stops_at_the_target_or_when_time_is_up(ball):
    quick = {**QUICK, "iterations": 100000}
    stopped = af.fit_sdf(*ball, af.FitOptions(**quick, target_error=0.01)).report
    assert stopped["stopped_by"] == "target_error" and stopped["near_mean"] < 0.012 * stopped["scale"]
    report = af.fit_sdf(*ball, af.FitOptions(**quick, time_budget=0.5)).report
    assert report.stopped_by == "time_budget" and report.seconds > 0.5


def test_adam_learns_too(ball):
    options = af.FitOptions(**QUICK, optimizer="adam", learning_rate=5e-3)
    assert af.fit_sdf(*ball, options).report.near_mean < 0.15


def test_cancel_takes_effect_soon_and_progress_only_rises(ball):
    task, seen, times = af.Task(), [], {}

    def watch():
        while task.progress < 0.15 and len(seen) < 100000:
            seen.append(task.progress)
            time.sleep(0.001)
        seen.append(task.progress)
        times["cancel"] = time.perf_counter()
        task.cancel()

    watcher = threading.Thread(target=watch)
    watcher.start()
    with pytest.raises(af.Cancelled):
        af.fit_sdf(*ball, af.FitOptions(**{**QUICK, "iterations": 2000}), task=task)
    latency = time.perf_counter() - times["cancel"]
    watcher.join()
    assert latency < 2.0  # 0.2 s on an idle machine
    assert seen == sorted(seen) and seen[-1] < 1
    assert "iteration" in task.message


def test_leaving_the_finite_numbers_keeps_the_last_good_state(ball):
    with pytest.raises(af.Diverged, match="learning_rate") as error:
        af.fit_sdf(*ball, af.FitOptions(**QUICK, learning_rate=1e30))
    good = error.value.last_good
    assert np.isfinite(good(ball[0])).all() and good.report.stopped_by == "diverged"


@pytest.mark.parametrize("iterations", [1, 2, 11])
@pytest.mark.parametrize("rate", [1e30, 1e12])
def test_a_last_step_to_infinity_is_a_divergence(ball, rate, iterations):
    options = {**QUICK, "batch": 1, "iterations": iterations, "learning_rate": rate}
    try:
        kept = af.fit_sdf(*ball, af.FitOptions(**options))
    except af.Diverged as error:
        kept = error.last_good
    assert np.isfinite(kept(ball[0])).all()
    assert np.isfinite([kept.report.near_mean, kept.report.near_max, kept.report.volume_max]).all()


def test_a_fit_survives_its_file(fitted, tmp_path):
    fitted.save(tmp_path / "ball.safetensors")
    loaded = af.NeuralSdf.load(tmp_path / "ball.safetensors")
    points = np.random.default_rng(3).uniform(1, 8, (100, 3))
    assert np.array_equal(loaded(points), fitted(points))
    assert loaded.frame == fitted.frame and loaded.report == fitted.report


@pytest.mark.parametrize(
    "wrong,word",
    [
        ({"iterations": 0}, "iterations"),
        ({"batch": 0}, "batch"),
        ({"near_share": 1.5}, "near_share"),
        ({"near_spread": float("nan")}, "near_spread"),
        ({"optimizer": "sgd"}, "muon"),
        ({"device": "tpu"}, "device"),
        ({"width": 0}, "width"),
        ({"threads": -1}, "threads"),
        ({"colour": 1}, "colour"),
    ],
)
def test_wrong_options_are_named(ball, wrong, word):
    with pytest.raises(af.InvalidInput, match=word):
        af.fit_sdf(*ball, af.FitOptions(**wrong))


def test_wrong_meshes_are_named(ball):
    vertices, triangles = ball
    for bad, word in [
        ((vertices[:0], triangles), "vertices"),
        ((vertices, triangles[:0]), "triangles"),
        ((vertices * np.nan, triangles), "vertices"),
        ((vertices, triangles + 1000), "triangles"),
        ((vertices[:, :2], triangles), "vertices"),
    ]:
        with pytest.raises(af.InvalidInput, match=word):
            af.fit_sdf(*bad)
