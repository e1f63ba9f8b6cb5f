# SPDX-License-Identifier: GPL-3.0-or-later
"""NeuralSdf: published networks against PyTorch, its files, and what it refuses."""

import os
import subprocess
import sys
import zipfile
from itertools import pairwise

import numpy as np
import pytest
from network_oracle import Network
from tolerances import PUBLISHED_GRADIENT, PUBLISHED_VALUE

import arapfields as af
from arapfields import _files

torch = pytest.importorskip("torch")


def small_layers(seed=0, width=8, layers=2, octaves=4):
    rng = np.random.default_rng(seed)
    sizes = [6 * octaves, *[width] * layers, 1]
    weights = [rng.normal(size=(b, a)) / a**0.5 for a, b in pairwise(sizes)]
    return weights, [rng.normal(size=b) * 0.1 for b in sizes[1:]]


@pytest.fixture
def sdf():
    return af.NeuralSdf.from_layers(*small_layers())


@pytest.mark.parametrize("name", ["bunny", "cube", "hand", "spot", "whale", "frog"])
def test_published_networks_equal_torch(data_dir, name):
    path = data_dir / "neural_sdf" / f"{name}.pt"
    network = Network.published(path)
    sdf = af.NeuralSdf.from_layers(*network.layers)
    points = np.random.default_rng(4).uniform(-1, 1, (3000, 3))
    expected = network.jets(points, 1)[..., 0].detach().numpy()
    assert np.abs(sdf(points) - expected[0]).max() < PUBLISHED_VALUE
    assert np.abs(sdf.gradient(points).T - expected[1:]).max() < PUBLISHED_GRADIENT
    assert sdf.frame == af.Frame((0, 0, 0), 1)
    assert sdf.report == {}


def test_outside_the_cube_the_distance_to_the_cube_is_added(sdf):
    inside = np.array([[1.0, 0.3, -1.0], [0.2, 1.0, 0.1]])
    beyond = inside + np.array([[3.0, 0.0, -4.0], [0.0, 0.5, 0.0]])
    np.testing.assert_allclose(sdf(beyond), sdf(inside) + np.array([5.0, 0.5]), atol=1e-6)
    step, axes = 1e-2, np.eye(3)
    far = np.array([[2.0, 0.3, -3.0]])
    slopes = [(sdf(far + step * e) - sdf(far - step * e))[0] / (2 * step) for e in axes]
    np.testing.assert_allclose(sdf.gradient(far)[0], slopes, atol=2e-3)


def test_saved_and_loaded_is_the_same_bit_for_bit(sdf, tmp_path):
    path = tmp_path / "shape.npz"
    sdf.save(path)
    again = af.NeuralSdf.load(str(path))
    points = np.random.default_rng(5).uniform(-1, 1, (200, 3))
    assert np.array_equal(sdf(points), again(points))
    assert again.frame == sdf.frame and again.report == sdf.report
    again.save(tmp_path / "again.npz")
    assert path.read_bytes()[:4] == (tmp_path / "again.npz").read_bytes()[:4]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["again.npz", "shape.npz"]


@pytest.mark.parametrize("level", ["baseline", "avx2", "avx512"])
def test_kernels_for_every_instruction_set_agree(level):
    code = (
        "import numpy as np, sys; sys.path.insert(0, 'tests')\n"
        "from arapfields import _native; from python.test_neural_sdf import small_layers\n"
        "from arapfields._native import testing\n"
        "w, b = small_layers(width=37)\n"
        "x = np.random.default_rng(0).uniform(-1, 1, (100, 3)); c = np.cos(np.arange(1000))\n"
        "jets, gradient = testing.mlp_jets(w, b, 4, 1.0, 30.0, x, 2, c, False)\n"
        "print(_native.simd_level(), *jets.ravel(), *gradient)"
    )

    def run(name):
        environment = {**os.environ, "ARAPFIELDS_SIMD": name}
        root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
        command = [sys.executable, "-c", code]
        output = subprocess.run(command, env=environment, cwd=root, capture_output=True, text=True)
        assert output.returncode == 0, output.stderr
        used, *numbers = output.stdout.split()
        return used, np.array(numbers, float)

    used, numbers = run(level)
    if used != level:
        pytest.skip(f"this processor has no {level}")
    _, reference = run("baseline")
    assert np.abs(numbers - reference).max() < 1e-5 * np.abs(reference).max()


def rewritten(path, **changes):
    """The archive at `path` with entries replaced (or, for None, left out)."""
    with np.load(path) as archive:
        entries = {name: archive[name] for name in archive.files}
    entries.update(changes)
    target = path.with_name("changed.npz")
    np.savez(target, **{name: value for name, value in entries.items() if value is not None})
    return target


def refused(path, *words):
    with pytest.raises(af.InvalidInput) as error:
        af.NeuralSdf.load(path)
    assert all(word in str(error.value) for word in (str(path), *words)), error.value


def test_unusable_files_are_refused_by_name(sdf, tmp_path):
    path = tmp_path / "good.npz"
    sdf.save(path)
    content = path.read_bytes()
    bad = tmp_path / "bad.npz"
    for text in (b"", content[: len(content) // 2], content[:-40], b"hello", os.urandom(500)):
        bad.write_bytes(text)
        refused(bad)
    with zipfile.ZipFile(bad, "w") as archive:
        archive.writestr("other.txt", "x")
    refused(bad)
    np.savez(bad, header=np.array([object()], dtype=object))
    refused(bad)
    weight = "state.network.weights.0"
    header = bytes(np.load(path)["header"]).decode()
    for old, new, word in [
        ('"sdf"', '"field"', "field"),
        ('"version": 1', '"version": 99', "version"),
        ('"arapfields"', '"other"', "format"),
        ('"octaves": 4', '"octaves": 3', "weights[0]"),
        ('"scale": 1.0', '"scale": -1.0', "scale"),
        ('"frequency"', '"other"', "missing"),
    ]:
        assert old in header
        changed = np.frombuffer(header.replace(old, new, 1).encode(), np.uint8)
        refused(rewritten(path, header=changed), word)
    values = np.load(path)[weight]
    refused(rewritten(path, **{weight: values[:, :5]}), "weights[0]")
    refused(rewritten(path, **{weight: values * np.nan}), "NaN")
    refused(rewritten(path, **{weight: None}), "missing")
    with pytest.raises(FileNotFoundError):
        af.NeuralSdf.load(tmp_path / "none.npz")
    with pytest.raises(OSError):
        af.NeuralSdf.load(tmp_path)


def test_a_failing_disk_leaves_nothing_behind(tmp_path):
    """A limit on the size of files stands for a full disk: the write fails half way."""
    old = tmp_path / "old.npz"
    old.write_bytes(b"before")
    code = (
        "import resource, sys, numpy as np\nfrom arapfields import _files\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
        "state = {'x': np.zeros(100000)}\n"
        "for name in ('new.npz', 'old.npz'):\n"
        "    try:\n        _files.save_state(sys.argv[1] + '/' + name, 'sdf', state)\n"
        "    except OSError as error:\n        print(type(error).__name__)\n"
    )
    command = [sys.executable, "-c", code, str(tmp_path)]
    output = subprocess.run(command, capture_output=True, text=True, check=True)
    assert output.stdout.split() == ["OSError", "OSError"]
    assert [p.name for p in tmp_path.iterdir()] == ["old.npz"] and old.read_bytes() == b"before"
    with pytest.raises(FileNotFoundError):
        _files.save_state(tmp_path / "no folder" / "x.npz", "sdf", {})


def test_states_of_any_nesting_return(tmp_path):
    state = {"a": np.arange(6.0).reshape(2, 3), "b": [1, 2.5, None, {"c": np.int64(3)}], "e": np.array(0.1)}
    _files.save_state(tmp_path / "s.npz", "field", state)
    loaded = _files.load_state(tmp_path / "s.npz", "field")
    assert np.array_equal(loaded["a"], state["a"]) and loaded["b"] == [1, 2.5, None, {"c": 3}]
    assert loaded["e"].shape == () and loaded["e"] == 0.1
    with pytest.raises(af.InvalidInput, match=r"state\.x"):
        _files.save_state(tmp_path / "t.npz", "field", {"x": object()})


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
