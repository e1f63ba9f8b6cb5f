# SPDX-License-Identifier: GPL-3.0-or-later
"""The cache of fits: keys that follow content and options, files that come and go."""

from pathlib import Path

import numpy as np
import pytest
from support.geometry.meshes import sphere

import arapfields as af
from addon.core.runtime.fit_cache import FitCache, fit_key

V = np.random.default_rng(0).normal(size=(10, 3))
F = np.arange(9).reshape(3, 3)
OPTIONS = {"width": 64, "seed": 0}


def test_equal_content_has_an_equal_key():
    assert fit_key(V, F, OPTIONS, 1) == fit_key(V.copy(), F.astype(np.int32), dict(OPTIONS), 1)


def test_the_machine_does_not_enter_the_key():
    assert fit_key(V, F, {**OPTIONS, "threads": 3, "device": "cpu"}, 1) == fit_key(V, F, OPTIONS, 1)


@pytest.mark.parametrize("change", ["vertex", "triangle", "option", "version"])
def test_every_change_of_content_changes_the_key(change):
    v, f, options, version = V.copy(), F.copy(), dict(OPTIONS), 1
    if change == "vertex":
        v[3, 1] += 1e-4
    if change == "triangle":
        f[0] = f[0][::-1]
    if change == "option":
        options["seed"] = 1
    if change == "version":
        version = 2
    assert fit_key(v, f, options, version) != fit_key(V, F, OPTIONS, 1)


def test_meshes_in_any_unit_have_different_keys():
    for scale in (1e-9, 1e9):
        assert fit_key(V * scale, F, OPTIONS, 1) != fit_key(V * scale * 1.01, F, OPTIONS, 1)
        assert fit_key(V * scale, F, OPTIONS, 1) != fit_key(V[::-1] * scale, F, OPTIONS, 1)


def read(path):
    text = Path(path).read_text()
    if text == "broken":
        raise ValueError("not a fit")
    return text


@pytest.fixture(scope="module")
def fit():
    options = af.FitOptions(iterations=1, width=4, layers=1, near_points=300, uniform_points=50)
    return af.fit_sdf(*sphere(1.0, 1), options)


KEY = fit_key(V, F, OPTIONS, 1)


def test_saved_fits_are_found_counted_and_cleared(tmp_path, fit):
    cache = FitCache(tmp_path / "fits")
    assert cache.load(KEY, af.NeuralSdf.load) is None and cache.size() == 0 and cache.clear() == 0
    cache.save(KEY, fit.save)
    assert cache.load(KEY, af.NeuralSdf.load).report == fit.report
    assert cache.size() == cache.path(KEY).stat().st_size
    assert cache.clear() == 1 and cache.load(KEY, af.NeuralSdf.load) is None


def test_no_other_file_is_cleared(tmp_path, fit):
    field = af.deform(af.sample_mesh(*sphere(1.0, 1), 50), [af.PointHandle([0, 0, 1], [0, 0, 1])])
    cache, others = FitCache(tmp_path), []
    cache.save(KEY, fit.save)
    header = b'{"__metadata__":{"format":"pt"}}'
    contents = [b"", b"precious", b"\xff" * 40, b"[" * 9000, len(header).to_bytes(8, "little") + header]
    for number, content in enumerate(contents):  # named as fits are, of other programs
        others.append(cache.path(f"{number:032x}"))
        others[-1].write_bytes(content)
    others.append(cache.path("f" * 32))
    field.save(others[-1])
    for name in ("my_network", KEY.upper(), f"{KEY}.old", KEY[:-1], f"x{KEY}"):
        others.append(cache.path(name))
        fit.save(others[-1])
    (tmp_path / "other.txt").write_text("kept")
    cache.path("0" * 31 + "a").mkdir()
    assert cache.size() == cache.path(KEY).stat().st_size
    assert cache.clear() == 1 and not cache.path(KEY).exists()
    assert all(path.exists() for path in others) and len(list(tmp_path.iterdir())) == len(others) + 2


def test_a_fit_that_cannot_be_read_now_is_not_removed(tmp_path):
    def refused(path):
        raise PermissionError(13, "Permission denied", path)

    cache = FitCache(tmp_path)
    cache.save(KEY, lambda path: Path(path).write_text("fit"))
    assert cache.load(KEY, refused) is None and cache.path(KEY).exists()


def test_a_broken_file_is_removed_and_counts_as_missing(tmp_path):
    cache = FitCache(tmp_path)
    cache.save("a", lambda path: Path(path).write_text("broken"))
    assert cache.load("a", read) is None
    assert not cache.path("a").exists()
