# SPDX-License-Identifier: GPL-3.0-or-later
"""NeuralSdf: published networks against PyTorch, its files, and what it refuses."""

import functools
import os
import subprocess
import sys

import numpy as np
import pytest
from support.geometry.layers import small_layers
from support.oracles.network import Network
from support.tolerances import PUBLISHED_GRADIENT, PUBLISHED_VALUE

import arapfields as af

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
        "from arapfields import _native; from support.geometry.layers import small_layers\n"
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


def test_layers_are_what_from_layers_takes(sdf):
    weights, biases, octaves, frequency, sharpness = sdf.layers
    again = af.NeuralSdf.from_layers(weights, biases, octaves, frequency, sharpness)
    points = np.random.default_rng(5).uniform(-1, 1, (100, 3))
    assert np.array_equal(again(points), sdf(points))
    assert [w.shape for w in weights] == [w.shape for w in small_layers()[0]]
