# SPDX-License-Identifier: GPL-3.0-or-later
"""What `make test-arm64` compares and runs, as far as it needs no other processor; and the words of make."""

import re
from pathlib import Path

import numpy as np
import pytest

from tests.arm64 import __main__ as arm64
from tests.arm64 import reference

ROOT = Path(__file__).resolve().parents[2]


def test_the_listed_tests_exist():
    assert len(set(arm64.PYTHON_TESTS)) == len(arm64.PYTHON_TESTS)
    for name in arm64.PYTHON_TESTS:
        assert (ROOT / f"tests/python/{name}.py").is_file(), name


@pytest.mark.parametrize("change", ["none", "small", "large", "not a number", "shape"])
def test_figures_of_two_processors_are_told_apart(tmp_path, change):
    figures = {name: np.linspace(1, 2, 5) for name in reference.ALLOWED}
    np.savez(tmp_path / "here.npz", **figures)
    name, allowed = "distances of a torus", reference.ALLOWED["distances of a torus"]
    factor = {"small": 1 + allowed / 4, "large": 1 + 4 * allowed, "not a number": np.nan}.get(change, 1.0)
    figures[name] = figures[name][:3] if change == "shape" else figures[name] * factor
    np.savez(tmp_path / "there.npz", **figures)
    rows = reference.compare(tmp_path / "here.npz", tmp_path / "there.npz")
    assert [row[0] for row in rows] == list(reference.ALLOWED)
    failed = [row[0] for row in rows if not row[1] <= row[2]]
    assert failed == ([] if change in ("none", "small") else [name])


def test_every_word_of_make_is_described():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    words = set(re.findall(r"^([a-z0-9-]+):.*##", makefile, flags=re.M)) - {"help"}
    phony = set(re.search(r"^\.PHONY: (.*)$", makefile, flags=re.M)[1].split()) - {"help"}
    page = (ROOT / "docs/development.md").read_text(encoding="utf-8")
    line = next(line for line in page.splitlines() if line.startswith("`make help` lists"))
    assert words == phony == set(re.findall(r"`([a-z0-9-]+)`", line))
