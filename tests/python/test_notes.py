# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report notes on a result that should not be used unseen, and where the notes are shown."""

import pytest
from support.geometry import cases
from support.programs.cli import HELD_AND_SHIFTED, SMALL_SOLVE, run, write_octahedron

import arapfields as af

QUICK = dict(width=32, layers=3, iterations=60, batch=100, handle_batch=50)


@pytest.mark.parametrize("kind", ["radial", "neural"])
def test_folds_and_far_targets_are_noted(kind):
    samples = cases.bar_samples()
    left, right = (h.rest for h in cases.bar_handles())

    def solve(way):
        handles = [cases.moved(left), cases.moved(right, cases.shift([way, 0.0, 0.0]))]
        return af.deform(samples, handles, af.DeformOptions(field=kind, **QUICK)).report

    assert solve(0.1).notes == () and solve(0.1).far_target is None
    torn = solve(-800.0)  # 500 times its length, through itself
    assert torn.flipped_share > 0.0
    folds, far = torn.notes
    assert f"{100 * torn['flipped_share']:.3g} %" in folds and f"{torn['min_determinant']:.3g}" in folds
    assert far.startswith("handles[1]") and f"{torn['far_target']:.3g} times" in far
    assert torn.far_target == pytest.approx(500.0, rel=0.01)


def test_live_notes_come_and_go():
    left, right = (h.rest for h in cases.bar_handles())
    live = af.LiveDeformer(cases.bar_samples(), [cases.moved(left), cases.moved(right)])
    live.solve([left, cases.shift([-800.0, 0.0, 0.0]) @ right])
    assert any("handles[1]" in note for note in live.report.notes)
    live.reset()
    live.solve([left, right])
    assert live.report.notes == ()


def test_notes_are_printed(tmp_path, capsys):
    write_octahedron(tmp_path / "mesh.obj")
    far = [*HELD_AND_SHIFTED[:-1], "-900,0,0", "-o", tmp_path / "torn.ply", *SMALL_SOLVE]
    assert run("deform", tmp_path / "mesh.obj", *far) == 0
    shown = capsys.readouterr()
    assert "note: handles[1]: its target is 4" in shown.err and "note:" not in shown.out
    assert run("deform", tmp_path / "mesh.obj", *far, "--quiet") == 0
    assert capsys.readouterr().err == ""
