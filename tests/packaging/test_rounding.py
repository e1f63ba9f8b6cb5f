# SPDX-License-Identifier: GPL-3.0-or-later
"""The tests at other roundings (tests/rounding.py): its parts and its displacements."""

from collections import Counter

import numpy as np
from support.geometry import nudge

from tests import rounding


def test_parts_take_each_file_under_each_condition_in_turn():
    every, files = rounding.conditions("avx2", None, [0, 1]), [f"test_{k}.py" for k in range(50)]
    assert every == [("baseline", 0), ("baseline", 1), ("avx2", 1)]
    taken = Counter()
    for number in range(100, 100 + len(every) * rounding.PARTS):
        [condition], some = rounding.part_of(every, files, number)
        taken.update((condition, file) for file in some)
    assert taken == Counter({(condition, file): 1 for condition in every for file in files})


def test_a_test_that_fails_is_named(tmp_path):
    file = tmp_path / "test_level.py"
    file.write_text("import os\ndef test_level():\n    assert os.environ['ARAPFIELDS_SIMD'] != 'avx2'\n")
    options = ["-q", "-p", "no:cacheprovider"]
    assert not rounding.failed_under("baseline", 0, [file], options)
    [failed] = rounding.failed_under("avx2", 0, [file], options)
    assert "test_level" in failed


def test_a_nudge_is_small_and_equal_points_stay_equal(monkeypatch):
    points = np.random.default_rng(0).normal(size=(1000, 3))
    points = np.concatenate([points, points[::-1]])
    monkeypatch.setattr(nudge, "NUMBER", 0)
    assert np.array_equal(nudge.nudged(points), points)
    moved = []
    for number in (1, 2):
        monkeypatch.setattr(nudge, "NUMBER", number)
        moved.append(nudge.nudged(points))
        away = np.abs(moved[-1] - points).max(0) / np.ptp(points, axis=0).max()
        assert (away > 0.5 * nudge.SIZE).all() and (away < nudge.SIZE).all()
        assert np.array_equal(moved[-1][:1000], moved[-1][:999:-1])
    assert not np.array_equal(*moved)
