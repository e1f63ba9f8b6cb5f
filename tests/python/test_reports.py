# SPDX-License-Identifier: GPL-3.0-or-later
"""Reports: their classes, their notes, and the measures of a mesh."""

import dataclasses
import json
import pickle

import numpy as np
import pytest
from support.geometry import cases
from support.geometry.cases import box, moved, turn
from support.geometry.meshes import sphere
from support.programs.cli import HELD_AND_SHIFTED, SMALL_SOLVE, run, write_octahedron

import arapfields as af
from arapfields import _report_files

# Reports: one frozen class for each kind, the same from attributes, by name, as a dict and from a file.

FIT = dict(iterations=150, width=32, layers=2, batch=256, near_points=5000, uniform_points=1000)


@pytest.fixture(scope="module")
def made():
    """Something that has each kind of report."""
    samples = cases.bar_samples(400)
    field = af.deform(samples, cases.bar_handles(), af.DeformOptions(field="radial", iterations=5))
    live = af.LiveDeformer(samples, cases.bar_handles())
    sdf = af.fit_sdf(*sphere(1.0, 2), af.FitOptions(**FIT))
    tiny = af.InverseTrainingOptions(iterations=2, width=8, layers=1)
    return {
        "FitReport": sdf,
        "SolveReport": field,
        "LiveReport": live.solve(),
        "InverseReport": af.train_inverse(field, samples, tiny),
        "SampleReport": af.sample_surface(sdf, 100),
        "ExtractionReport": af.extract_surface(sdf, 16),
        "DeformedExtractionReport": af.extract_deformed(sdf, live.solve(), 16),
    }


KINDS = [
    *("FitReport", "SolveReport", "LiveReport", "InverseReport"),
    *("SampleReport", "ExtractionReport", "DeformedExtractionReport"),
]


@pytest.mark.parametrize("kind", KINDS)
def test_a_report_is_frozen_typed_and_plain(made, kind):
    report = made[kind].report
    assert type(report) is getattr(af, kind)
    fields = dataclasses.fields(report)
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(report, fields[0].name, 1.0)
    for field in fields:
        value = getattr(report, field.name)
        assert report[field.name] == value
        if field.type in (int, float, bool, str):
            assert type(value) is field.type, field.name
    plain = report.to_dict()
    assert list(plain) == list(report) == [field.name for field in fields]
    assert json.loads(json.dumps(plain)) == plain
    with pytest.raises(KeyError):
        report["colour"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_report_survives_json(made, kind):
    report = made[kind].report
    assert _report_files.from_json(_report_files.to_json(report)) == report


@pytest.mark.parametrize("kind", ["FitReport", "SolveReport", "LiveReport", "InverseReport"])
def test_a_report_survives_its_file(made, kind, tmp_path):
    made[kind].save(tmp_path / "file")
    load = af.NeuralSdf.load if kind == "FitReport" else af.DeformationField.load
    assert load(tmp_path / "file").report == made[kind].report


def test_unmeasured_objects_have_no_report(made, tmp_path):
    layers = made["FitReport"].layers
    sdf = af.NeuralSdf.from_layers(*layers)
    sdf.save(tmp_path / "bare")
    for bare in (sdf, af.NeuralSdf.load(tmp_path / "bare"), af.sample_mesh(*sphere(1.0, 1), 10)):
        assert getattr(bare, "report", None) is None
        with pytest.raises(AttributeError, match="report"):
            bare.report  # noqa: B018


def test_reports_from_before_kinds_were_written_are_read(made):
    old = made["SolveReport"].report.to_dict()
    old["out_of_time"] = old.pop("stopped_by") == "time_budget"
    assert _report_files.from_json(json.dumps(old)) == made["SolveReport"].report
    for kind in ("FitReport", "LiveReport", "InverseReport"):
        old = made[kind].report.to_dict()
        assert _report_files.from_json(json.dumps(old)) == made[kind].report


@pytest.mark.parametrize("text", ["{}", '{"kind": "Sermon"}', '{"author": "somebody else"}'])
def test_reports_of_other_programs_are_ignored(text):
    assert _report_files.from_json(text) is None


PART = '{"kind": "FitReport", "iterations": 1}'


@pytest.mark.parametrize("text", [PART, '{"near_mean": 1}', "[1]", '{"kind": "FitReport", "x": 1}'])
def test_a_text_that_is_no_report_is_refused(text):
    with pytest.raises(ValueError, match="report"):
        _report_files.from_json(text)


def test_numbers_that_json_has_not_come_back_as_nan(made):
    report = dataclasses.replace(made["InverseReport"].report, error_max=float("nan"))
    assert np.isnan(_report_files.from_json(_report_files.to_json(report)).error_max)


def test_an_extraction_unpacks_and_keeps_its_report(made):
    mesh = made["ExtractionReport"]
    V, F = mesh
    assert V is mesh.vertices and F is mesh.triangles and len(mesh) == 2
    assert V.dtype == np.float64 and F.dtype == np.int32
    again = pickle.loads(pickle.dumps(mesh))
    assert np.array_equal(again.vertices, V) and again.report == mesh.report
    with pytest.raises(AttributeError):
        mesh.report = None


def test_older_names_are_the_same_classes():
    assert (af.Cuboid, af.Point, af.Region) == (af.CuboidHandle, af.PointHandle, af.RegionHandle)
    assert af.InverseOptions is af.InverseTrainingOptions


@pytest.mark.parametrize(
    "call",
    [
        lambda s, t: af.deform(s, [], af.DeformOptions(), t),
        lambda s, t: af.stylize(s, "cube", af.StylizeOptions(), t),
        lambda s, t: af.sharpen(np.eye(3), [[0, 1, 2]], np.eye(3), "cube", af.SharpenOptions(), t),
        lambda s, t: af.fit_sdf(np.eye(3), [[0, 1, 2]], af.FitOptions(), t),
        lambda s, t: af.LiveDeformer(s, [], af.LiveOptions(), t),
        lambda s, t: af.sample_mesh(np.eye(3), [[0, 1, 2]], 10, 0),
        lambda s, t: af.signed_distance(np.eye(3), [[0, 1, 2]], np.eye(3), 1),
        lambda s, t: af.deform_curve(np.zeros((3, 2)), [], af.CurveOptions(), t),
    ],
)
def test_arguments_after_options_are_keyword_only(call):
    with pytest.raises(TypeError):
        call(cases.bar_samples(50), af.Task())


def test_a_wrap_report_is_restored_equal(tmp_path):
    vertices, triangles = sphere(1.0, 1)
    options = af.WrapOptions(centers=20, stages=2, iterations=1, threads=1)
    landmarks = [(vertices[i], 2 * vertices[i]) for i in (0, 3, 7)]
    samples = af.sample_mesh(vertices, triangles, 200)
    field = af.wrap(samples, af.MeshSdf(2 * vertices, triangles), landmarks, options)
    field.save(tmp_path / "wrap.safetensors")
    assert af.DeformationField.load(tmp_path / "wrap.safetensors").report == field.report


@pytest.mark.parametrize(
    "name, value",
    [("iterations", 1.5), ("iterations", "3"), ("seconds", "x"), ("seconds", True), ("error_mean", [])],
)
def test_a_report_s_fields_are_read_with_their_types(name, value):
    told = {"kind": "InverseReport", "error_mean": 0.5, "error_max": 1, "iterations": 3, "seconds": None}
    read = _report_files.from_json(json.dumps(told))
    assert type(read.error_max) is float and np.isnan(read.seconds)
    with pytest.raises(ValueError, match=f"does not fit: {name}"):
        _report_files.from_json(json.dumps({**told, name: value}))


# What a report notes on a result that should not be used unseen, and where the notes are shown.

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


# The report tells what happens to the mesh's own triangles, not to samples alone.


def strips(columns):
    """A bar along x from −1 to 1 whose long sides have so many columns of triangles."""
    x = np.linspace(-1.0, 1.0, columns + 1)
    ring = 0.15 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    vertices = np.array([(a, *p) for a in x for p in ring])
    faces = []
    for i in range(columns):
        for k in range(4):
            a, b = 4 * i + k, 4 * i + (k + 1) % 4
            faces += [(a, b + 4, b), (a, a + 4, b + 4)]
    end = 4 * columns
    faces += [(0, 1, 2), (0, 2, 3), (end, end + 2, end + 1), (end, end + 3, end + 2)]
    return vertices, np.array(faces)


def bent(vertices, triangles, degrees, pivot=(0.0, 0.0, 0.0)):
    ends = [
        moved(box((-1.1, -0.3, -0.3), (-0.8, 0.3, 0.3))),
        moved(box((0.8, -0.3, -0.3), (1.1, 0.3, 0.3)), turn((0, 0, 1), degrees, pivot)),
    ]
    return af.deform(af.sample_mesh(vertices, triangles), ends)


def test_a_fine_bar_is_bent_without_a_note():
    assert bent(*strips(40), 60.0).report.notes == ()


def test_stretches_of_the_mesh_s_own_triangles_are_in_the_report():
    vertices, triangles = strips(24)
    field = bent(vertices, triangles, 80.0)
    stretches = np.linalg.svd(field.jacobian(vertices[triangles].mean(axis=1)), compute_uv=False)
    rounding = 1e-9
    assert field.report.max_stretch >= stretches.max() - rounding
    assert field.report.min_determinant <= np.prod(stretches, axis=1).min() + rounding


def test_triangles_too_long_for_the_motion_are_located():
    # Slivers that reach along the whole bar, in a plane: its one end comes round to behind the other one.
    vertices, triangles = strips(40)
    rows = np.linspace(-0.15, 0.15, 30)
    extra = np.array([(side, y, 0.15) for y in rows for side in (-1.0, 1.0)])
    start = len(vertices)
    slivers = [(start + 2 * i, start + 2 * i + 1, start + 2 * i + 2) for i in range(29)]
    field = bent(np.vstack([vertices, extra]), np.vstack([triangles, slivers]), 140.0, (-0.3, 0.0, 0.0))
    mesh_vertices, mesh_triangles = np.vstack([vertices, extra]), np.vstack([triangles, slivers])
    corners = field.apply(mesh_vertices, triangles=mesh_triangles)[mesh_triangles]
    rest = mesh_vertices[mesh_triangles]
    before = np.cross(rest[:, 1] - rest[:, 0], rest[:, 2] - rest[:, 0])
    after = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    jacobians = field.jacobian(rest.mean(axis=1))
    expected = np.einsum("nji,nj->ni", np.linalg.inv(jacobians), before)
    turned = (np.linalg.det(jacobians) > 0) & ((expected * after).sum(axis=1) < 0)
    told = [note for note in field.report.notes if "turn over" in note]
    assert turned.sum() > 0.002 * len(mesh_triangles)
    assert told[0].startswith(f"{turned.sum()} of {len(mesh_triangles)} triangles turn over")
    assert field.report.turned_triangles == turned.sum() and field.report.to_dict()["turned_triangles"] > 0
    assert bent(*strips(40), 60.0).report.turned_triangles == 0
