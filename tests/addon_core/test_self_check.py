# SPDX-License-Identifier: GPL-3.0-or-later
"""The report that says whether the library works on a machine: right here, and wrong where something is."""

import platform
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from addon.core.runtime import native, self_check


def test_everything_works_here():
    lines, works = self_check.run()
    assert works, lines
    assert sum(": right (" in line for line in lines) == len(self_check.CHECKS)
    assert any("kernels for" in line and "products by" in line for line in lines)


def test_a_failure_is_named_and_the_others_go_on():
    def broken(library):
        raise ValueError("no luck")

    lines, works = self_check.run({"broken": broken, "distances": self_check.distances})
    assert not works
    assert lines[-2].startswith("broken: ValueError: no luck (") and lines[-1].startswith(
        "distances: right ("
    )


@pytest.mark.parametrize("answer", [lambda *_: np.zeros(4), lambda *_: np.full(4, np.nan)])
def test_wrong_figures_are_no_right_answer(answer):
    with pytest.raises(AssertionError, match="off by"):
        self_check.distances(SimpleNamespace(signed_distance=answer))


def test_accepted_bad_input_fails_the_check():
    with pytest.raises(AssertionError, match="not refused"):
        self_check.refusal(SimpleNamespace(signed_distance=lambda *_: None, InvalidInput=ValueError))


def test_a_zip_without_a_matching_wheel_lists_its_wheels(tmp_path, monkeypatch):
    """Blender unpacks the wheels for its own Python and system alone."""
    for python in ("cp311", "cp313.cp314"):
        (tmp_path / f"arapfields-0.1.0-{python}-{python}-win_arm64.whl").touch()
    monkeypatch.setattr(native, "WHEELS", tmp_path)
    said = str(native._missing(ModuleNotFoundError(name="arapfields")))
    assert platform.machine() in said and "(it has: 3.11, 3.13, 3.14, win_arm64)" in said
    monkeypatch.setattr(native, "WHEELS", tmp_path / "none")
    assert "not part of this installation" in str(native._missing(ModuleNotFoundError(name="arapfields")))


def test_an_unsupported_system_is_named_in_one_line(tmp_path, monkeypatch):
    """As the loader of a system that is too old, or of another processor, says it."""
    (tmp_path / "arapfields.py").write_text("raise ImportError('GLIBC_2.28 not found')", encoding="utf-8")
    for name in [name for name in sys.modules if name.partition(".")[0] == "arapfields"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(tmp_path)
    said = str(native._try_import())
    assert said == "The native library cannot be loaded: GLIBC_2.28 not found"
