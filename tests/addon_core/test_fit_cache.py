# SPDX-License-Identifier: GPL-3.0-or-later
"""The cache of fits: keys that follow content and options, files that come and go."""

from pathlib import Path

import numpy as np
import pytest

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


def test_meshes_of_any_unit_are_told_apart():
    for scale in (1e-9, 1e9):
        assert fit_key(V * scale, F, OPTIONS, 1) != fit_key(V * scale * 1.01, F, OPTIONS, 1)
        assert fit_key(V * scale, F, OPTIONS, 1) != fit_key(V[::-1] * scale, F, OPTIONS, 1)


def read(path):
    text = Path(path).read_text()
    if text == "broken":
        raise ValueError("not a fit")
    return text


def test_what_is_saved_is_found_counted_and_cleared(tmp_path):
    cache = FitCache(tmp_path / "fits")
    assert cache.load("a", read) is None and cache.size() == 0 and cache.clear() == 0
    cache.save("a", lambda path: Path(path).write_text("fit"))
    assert cache.load("a", read) == "fit" and cache.size() == 3
    (cache.folder / "other.txt").write_text("kept")
    assert cache.clear() == 1 and cache.load("a", read) is None
    assert (cache.folder / "other.txt").exists()


def test_a_broken_file_is_removed_and_counts_as_missing(tmp_path):
    cache = FitCache(tmp_path)
    cache.save("a", lambda path: Path(path).write_text("broken"))
    assert cache.load("a", read) is None
    assert not cache.path("a").exists()
