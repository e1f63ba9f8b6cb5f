# SPDX-License-Identifier: GPL-3.0-or-later
"""What a device computes, compositions of libtorch's operations, against the kernels in main memory."""

import contextlib

import numpy as np
import pytest
import torch
from support import tolerances
from support.geometry import cases, meshes
from support.oracles import jets_with_jacobians, random_rotations

import arapfields as af
from arapfields._native import testing

# Signed singular values whose closest rotation is unique: no two of them cancel.
SINGULAR_VALUES = {
    "usual": [1.2, 1.0, 0.7],
    "rotation": [1.0, 1.0, 1.0],
    "reflected": [2.0, 1.0, -0.5],
    "flat": [1.0, 0.6, 0.0],
    "nearly a line": [1.0, 0.02, 0.0],
    "reflected, K clamped": [1.0, 0.5, -0.497],
    "collapsed, K clamped": [0.004, 0.003, 0.002],
    "large": [1e4, 3e3, 1e3],
}
STYLE = af.preferred_normals("cube")
needs_cuda = pytest.mark.skipif(not torch.cuda.is_available(), reason="torch reports no CUDA device")


@contextlib.contextmanager
def device_path():
    scope = testing.DevicePath()
    yield
    del scope


def agree(found, expected, tolerance):
    for a, b in zip(found, expected, strict=True):
        assert np.abs(np.asarray(a) - b).max() <= tolerance * max(np.abs(b).max(), 1e-3)


def jets_of(sigma, rng, count=70):
    turns, others = random_rotations(count, rng), random_rotations(count, rng)
    return jets_with_jacobians(turns @ (np.array(sigma, float)[:, None] * others), rng)


@pytest.mark.parametrize("sigma", SINGULAR_VALUES.values(), ids=SINGULAR_VALUES)
def test_rigidity_equals_the_kernels(sigma):
    jets = jets_of(sigma, np.random.default_rng(0))
    for bending in (0.0, 0.01, 1.0):
        energy = testing.arap_energy(jets, bending, 0.7, composed=True)
        agree(energy, testing.arap_energy(jets, bending, 0.7), tolerances.COMPOSED)
    first = np.ascontiguousarray(jets[:4])
    energy = testing.arap_energy(first, 0.0, composed=True)
    agree(energy, testing.arap_energy(first, 0.0), tolerances.COMPOSED)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("sigma", [[1, 1, -1], [1, 0, 0], [0, 0, 0], [3, 1e-9, -1e-9]], ids=str)
def test_ambiguous_rotations_stay_finite(sigma, dtype):
    jets = jets_of(sigma, np.random.default_rng(1)).astype(dtype)
    stretch, bend, cotangents = testing.arap_energy(jets, 0.01, composed=True)
    assert stretch == pytest.approx(((np.array(sigma) - 1) ** 2).sum(), rel=1e-5)
    assert np.isfinite(bend) and np.isfinite(cotangents).all() and np.abs(cotangents).max() < 1e6


def test_rigidity_in_single_precision():
    jets = jets_of([1.2, 1.0, 0.7], np.random.default_rng(2)).astype(np.float32)
    energy = testing.arap_energy(jets, 0.01, composed=True)
    agree(energy, testing.arap_energy(jets, 0.01), tolerances.FLOAT32_ENERGY)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("sigma", SINGULAR_VALUES.values(), ids=SINGULAR_VALUES)
def test_gauss_and_barrier_equal_the_kernels(sigma, dtype):
    rng = np.random.default_rng(3)
    jets = np.ascontiguousarray(jets_of(sigma, rng)[:4]).astype(dtype)
    normals = rng.normal(size=(jets.shape[1], 3))
    normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(dtype)
    tolerance = tolerances.COMPOSED if dtype is np.float64 else 20 * tolerances.FLOAT32_ENERGY
    if sigma[1] < 0.03:  # J's minors are small: rounding of their differences weighs more
        tolerance *= 100
    for weights in (np.zeros(0), rng.uniform(size=jets.shape[1])):
        arguments = jets, normals, STYLE, 5.0, 0.6, weights.astype(dtype)
        barrier = testing.gauss_energy(*arguments, composed=True)
        agree(barrier, testing.gauss_energy(*arguments), tolerance)
    barrier = testing.fold_barrier(jets, 0.9, 0.6, composed=True)
    agree(barrier, testing.fold_barrier(jets, 0.9, 0.6), tolerance)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_handles_equal_the_kernels(dtype):
    rng = np.random.default_rng(4)
    handles = testing.BoundHandles(cases.bar_handles(30.0), cases.bar_samples(200).points)
    jets = rng.normal(size=(1, len(handles.sources), 3)).astype(dtype)
    tolerance = tolerances.COMPOSED if dtype is np.float64 else tolerances.FLOAT32_ENERGY
    energy = testing.handle_energy(jets, handles, 0.6, composed=True)
    agree(energy, testing.handle_energy(jets, handles, 0.6), tolerance)


TERMS = {
    "bend": dict(bending=0.05),
    "stylized": dict(preferred=STYLE, gauss=2.0, barrier=3.0),
    "everything": dict(bending=0.01, preferred=STYLE, gauss=2.0, barrier=3.0, margin=0.4, keep_stance=0.7),
}


@pytest.mark.parametrize("terms", TERMS.values(), ids=TERMS)
def test_losses_and_their_gradients_equal_the_kernels(terms):
    """The whole way in double precision: encoding, layers, adjoints, energies and all of it back."""
    samples = cases.bar_samples(60)
    parameters = None
    results = []
    for scope in (contextlib.nullcontext, device_path):
        with scope():
            probe = testing.LossProbe(samples, cases.bar_handles(30.0), **terms)
            if parameters is None:
                parameters = np.random.default_rng(5).normal(size=probe.size) * 0.2
            results.append(probe(parameters, seed=5))
    agree(results[1], results[0], tolerances.COMPOSED)


@pytest.mark.parametrize("optimizer", ["muon", "adam"])
def test_a_solve_arrives_where_the_kernels_do(optimizer):
    options = dict(iterations=60, width=48, layers=3, batch=200, optimizer=optimizer, threads=1, device="cpu")
    samples, handles = cases.bar_samples(600), cases.bar_handles(40.0)
    expected = af.deform(samples, handles, af.DeformOptions(**options)).report
    with device_path():
        report = af.deform(samples, handles, af.DeformOptions(**options)).report
    assert [i for i, _ in report["loss"]] == [i for i, _ in expected["loss"]]
    assert report["loss"][0][1] == pytest.approx(expected["loss"][0][1], rel=tolerances.FLOAT32_ENERGY)
    assert report["loss"][-1][1] == pytest.approx(expected["loss"][-1][1], rel=tolerances.COMPOSED_SOLVE)
    assert report["energy"] == pytest.approx(expected["energy"], rel=tolerances.COMPOSED_SOLVE)


def test_stylize_and_fit_arrive_where_the_kernels_do():
    samples = cases.bar_samples(600)
    vertices, faces = meshes.box()
    turned = STYLE @ cases.turn([1, 2, 0], 25)[:3, :3]
    style = af.StylizeOptions(iterations=40, width=48, layers=3, batch=200, threads=1, device="cpu")
    fit = af.FitOptions(
        iterations=60, width=48, layers=3, near_points=4000, uniform_points=1000, threads=1, device="cpu"
    )
    figures = []
    for scope in (contextlib.nullcontext, device_path):
        with scope():
            stylized = af.stylize(samples, turned, style).report
            near_mean = af.fit_sdf(vertices, faces, fit).report.near_mean
            figures.append((stylized["energy"], stylized["preference"], near_mean))
    assert figures[1] == pytest.approx(figures[0], rel=tolerances.COMPOSED_SOLVE)


def test_divergence_is_noticed_and_the_last_good_state_kept():
    options = af.DeformOptions(
        iterations=200, width=16, layers=2, batch=50, learning_rate=1e30, optimizer="adam", device="cpu"
    )
    with device_path(), pytest.raises(af.Diverged, match="was kept"):
        af.deform(cases.bar_samples(200), cases.bar_handles(), options)


@needs_cuda
@pytest.mark.parametrize("terms", TERMS.values(), ids=TERMS)
def test_losses_and_gradients_on_cuda_equal_the_kernels(terms):
    results = []
    for device in ("cpu", "cuda"):
        probe = testing.LossProbe(cases.bar_samples(60), cases.bar_handles(30.0), device=device, **terms)
        parameters = np.random.default_rng(5).normal(size=probe.size) * 0.2
        results.append(probe(parameters, seed=5))
    agree(results[1], results[0], tolerances.COMPOSED)


@needs_cuda
@pytest.mark.parametrize("extra", [{}, dict(start="radial", invertibility=0.1)], ids=str)
def test_a_cuda_device_arrives_where_the_processor_does(extra):
    results = []
    for device in ("cpu", "cuda"):
        options = af.DeformOptions(iterations=60, width=64, batch=200, device=device, **extra)
        field = af.deform(cases.bar_samples(600), cases.bar_handles(40.0), options)
        results.append(field)
    assert results[1].report.energy == pytest.approx(results[0].report.energy, rel=tolerances.COMPOSED_SOLVE)
    points = cases.bar_samples(100, seed=1).points
    assert np.abs(results[1](points) - results[0](points)).max() < 0.05


@needs_cuda
def test_exact_handles_on_a_cuda_device_start_as_on_the_processor():
    """After sixty steps the energies of two seeds differ by far more than those of two devices."""
    losses = []
    for device in ("cpu", "cuda"):
        options = af.DeformOptions(iterations=2, width=64, batch=200, device=device, exact_handles=True)
        report = af.deform(cases.bar_samples(600), cases.bar_handles(40.0), options).report
        losses.append([loss for _, loss in report.loss])
    assert losses[1] == pytest.approx(losses[0], rel=tolerances.FLOAT32_ENERGY)


@needs_cuda
def test_the_loop_does_not_wait_for_a_cuda_device(capfd):
    """Between two reads of the losses more iterations make no more of the waits that torch warns of."""
    samples, handles = cases.bar_samples(600), cases.bar_handles(40.0)
    waits = []
    torch.cuda.set_sync_debug_mode("warn")
    try:
        for iterations in (2, 5, 20):  # the first call also sets the device up
            af.deform(samples, handles, af.DeformOptions(iterations=iterations, width=64, device="cuda"))
            waits.append(capfd.readouterr().err.count("synchronizing CUDA operation"))
    finally:
        torch.cuda.set_sync_debug_mode("default")
    assert waits[1] > 0 and waits[2] == waits[1]


@needs_cuda
def test_a_device_without_memory_is_named_and_gets_it_back():
    samples, handles = cases.bar_samples(600), cases.bar_handles(40.0)
    many = af.SurfaceSamples(
        np.tile(samples.points, (500, 1)), np.tile(samples.normals, (500, 1)), frame=samples.frame
    )
    vast = af.DeformOptions(iterations=1, width=4096, layers=8, batch=len(many.points), device="cuda")
    with pytest.raises(MemoryError, match=r"^CUDA out of memory") as raised:
        af.deform(many, handles, vast)
    assert "frame #" not in str(raised.value)
    free, whole = torch.cuda.mem_get_info()
    assert free > 0.9 * whole
    af.deform(samples, handles, af.DeformOptions(iterations=1, device="cuda"))


@pytest.mark.parametrize(
    "name", ["cuda:x", "cudafoo", "cuda:", "cuda:-1", "cuda: 1", "cuda:99999999999", "gpu"]
)
def test_a_name_of_no_device_is_refused(name):
    with pytest.raises(af.InvalidInput, match=r"device: '.*'; 'auto', 'cpu', 'cuda' or 'cuda:N' is allowed"):
        af.deform(cases.bar_samples(100), cases.bar_handles(40.0), af.DeformOptions(device=name))


def test_a_missing_device_is_refused_with_the_reason():
    if torch.cuda.is_available():
        assert af.device_report() == "a CUDA device was found"
        with pytest.raises(af.InvalidInput, match="device: 'cuda:99'; the last CUDA device is 'cuda:"):
            af.deform(cases.bar_samples(100), cases.bar_handles(40.0), af.DeformOptions(device="cuda:99"))
        return
    assert af.device_report().startswith("no CUDA device: ")
    with pytest.raises(af.InvalidInput, match="device: 'cuda'; no CUDA device: "):
        af.deform(cases.bar_samples(100), cases.bar_handles(40.0), af.DeformOptions(device="cuda"))
