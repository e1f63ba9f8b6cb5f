# SPDX-License-Identifier: GPL-3.0-or-later
"""Options that go together under a name, in scripts and at the command line."""

import json

import pytest
from support.programs.cli import HELD_AND_SHIFTED, SMALL_SOLVE, run, write_octahedron

import arapfields as af


def test_a_preset_sets_what_other_flags_change(tmp_path):
    report = tmp_path / "report.json"
    write_octahedron(tmp_path / "mesh.obj")
    few = [*HELD_AND_SHIFTED, "--preset", "paper", *SMALL_SOLVE, "--quiet", "--report", report]
    assert run("deform", tmp_path / "mesh.obj", "-o", tmp_path / "moved.obj", *few) == 0
    assert json.loads(report.read_text())["iterations"] == 15
    field = af.DeformOptions.preset("paper")
    assert (field.field, field.optimizer, field.bending_unit) == ("neural", "adam", "cube")
    assert field.iterations != 15 and af.DeformOptions.preset("paper", iterations=15).iterations == 15
    assert af.StylizeOptions.preset("paper").keep_stance == 0.0
    assert af.FitOptions.preset("good") == af.FitOptions()
    with pytest.raises(af.InvalidInput, match="known are paper"):
        af.DeformOptions.preset("cloth")
    with pytest.raises(af.InvalidInput, match="unknown option 'x'"):
        af.DeformOptions.preset("paper", x=1)
