# SPDX-License-Identifier: GPL-3.0-or-later
"""sample_surface on a published network: uniform, on the surface, repeatable (shapes: native tests)."""

import numpy as np
import pytest
from support.oracles.network import Network
from support.tolerances import ON_SURFACE

import arapfields as af

COUNT = 6000
CELLS = 6  # a side: 216 cells


@pytest.fixture(scope="module")
def bunny(data_dir):
    return af.NeuralSdf.from_layers(*Network.published(data_dir / "neural_sdf" / "bunny.pt").layers)


@pytest.fixture(scope="module")
def samples(bunny):
    return af.sample_surface(bunny, COUNT, seed=1)


def histogram(points):
    return np.histogramdd(points, bins=CELLS, range=[(-1, 1)] * 3)[0].ravel() / len(points)


def total_variation(a, b):
    return 0.5 * np.abs(histogram(a) - histogram(b)).sum()


def test_points_lie_on_the_surface_with_its_normals(bunny, samples):
    assert samples.points.shape == samples.normals.shape == (COUNT, 3)
    assert np.abs(bunny(samples.points)).max() <= ON_SURFACE
    gradients = bunny.gradient(samples.points[:500])
    cosine = np.einsum("ij,ij->i", gradients, samples.normals[:500]) / np.linalg.norm(gradients, axis=1)
    assert cosine.min() > 1 - 1e-5


def test_as_uniform_as_samples_by_area(bunny, samples):
    V, F = af.extract_surface(bunny, 128)
    by_area = [af.sample_mesh(V, F, COUNT, seed=seed).points for seed in range(6)]
    between = np.mean([total_variation(a, b) for a, b in zip(by_area[::2], by_area[1::2], strict=True)])
    ours = np.mean([total_variation(samples.points, other) for other in by_area])
    assert ours <= 1.3 * between


def test_seed_decides_and_report_is_filled(bunny):
    a = af.sample_surface(bunny, 500, seed=3)
    report = a.report
    assert np.array_equal(a.points, af.sample_surface(bunny, 500, seed=3).points)
    assert not np.array_equal(a.points, af.sample_surface(bunny, 500, seed=4).points)
    assert report.evaluations > report.gradient_evaluations >= 500
    assert report.largest_value <= ON_SURFACE


def test_bad_arguments_cancel_and_no_surface(bunny):
    with pytest.raises(af.InvalidInput, match="count"):
        af.sample_surface(bunny, 0)
    with pytest.raises(af.InvalidInput, match="threads"):
        af.sample_surface(bunny, 10, threads=-1)
    task = af.Task()
    task.cancel()
    with pytest.raises(af.Cancelled):
        af.sample_surface(bunny, 10, task=task)
    flat = [np.zeros((4, 24)), np.zeros((1, 4))]
    with pytest.raises(af.InvalidInput, match="one sign"):
        af.sample_surface(af.NeuralSdf.from_layers(flat, [np.zeros(4), np.ones(1)]), 10)
