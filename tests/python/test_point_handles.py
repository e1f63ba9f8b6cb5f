# SPDX-License-Identifier: GPL-3.0-or-later
"""Point handles beside the surface: they move its nearest place and say so, or are refused."""

import json

import numpy as np
import pytest
import trimesh
from support.geometry.meshes import sphere
from support.programs.cli import run

import arapfields as af

SHIFT = np.array([0.3, 0, 0])


@pytest.mark.parametrize("off", [0.6, 1.2, 5.0])
def test_a_point_off_the_surface_moves_it_and_says_so_or_is_refused(off):
    """A ball of radius 1: within half its size of 2 a point stands for the surface's nearest place."""
    directions = np.random.default_rng(0).normal(size=(800, 3))
    ball = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    samples = af.SurfaceSamples(ball, ball)
    rest = np.array([0, 0, 1 + off])
    handles = [af.PointHandle([0, 0, -1], [0, 0, -1]), af.PointHandle(rest, rest + SHIFT)]
    live = lambda: af.LiveDeformer(samples, handles).solve([[0, 0, -1], rest + SHIFT])  # noqa: E731
    radial = lambda: af.deform(samples, handles, af.DeformOptions(field="radial"))  # noqa: E731
    for solve in (live, radial):
        if off > 1:
            with pytest.raises(af.InvalidInput, match=r"handles\[1\]: its point lies .* away from it"):
                solve()
            continue
        field = solve()
        assert field([[0, 0, 1.0]])[0, 0] > 0.25
        assert any("handles[1]" in note and "off the surface" in note for note in field.report.notes)


def test_the_command_line_refuses_it_too(tmp_path, capsys):
    trimesh.Trimesh(*sphere(1.0, 2), process=False).export(tmp_path / "ball.ply")
    handles = [{"type": "point", "rest": [0, 0, 6], "target": [1, 0, 6]}]
    (tmp_path / "handles.json").write_text(json.dumps(handles))
    given = [tmp_path / "ball.ply", "--handles", tmp_path / "handles.json", "-o", tmp_path / "x.ply"]
    assert run("deform", *given, "--field", "radial") == 2
    assert "handles[0]: its point lies" in capsys.readouterr().err and not (tmp_path / "x.ply").exists()
