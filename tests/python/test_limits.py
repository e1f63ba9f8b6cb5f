# SPDX-License-Identifier: GPL-3.0-or-later
"""Arguments that could end the process or take all memory: in processes with limits."""

import json
import os
import subprocess
import sys
import threading

import numpy as np
import pytest
from support.files import archives
from support.geometry.cases import bar_samples

import arapfields as af

PRELUDE = """
import resource, sys, numpy as np, arapfields as af
from pathlib import Path
sys.path[:0] = TESTS, ROOT
from fuzz.odd import make_things, TETRAHEDRON, FACES, ROWS, NORMALS
pages = int(Path("/proc/self/statm").read_text().split()[0])
limit = pages * resource.getpagesize() + (3 << 30)
things = make_things()
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
def refused(call, *words):
    try:
        call()
    except (af.InvalidInput, TypeError) as error:
        assert all(word in str(error) for word in words), error
    else:
        raise AssertionError(f"nothing was raised, {words}")
"""


def run(code):
    root = __file__.rsplit("/tests/", 1)[0]
    prelude = f"TESTS, ROOT = {root + '/tests'!r}, {root!r}\n" + PRELUDE
    done = subprocess.run([sys.executable, "-c", prelude + code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]


def test_objects_without_init_are_refused():
    """Whatever is asked of an object that __new__ alone has made."""
    run("""
for cls in [v for v in vars(af).values() if isinstance(v, type) and not issubclass(v, BaseException)]:
    for name in dir(cls):
        member = getattr(cls, name)
        if name.startswith("_") and name not in ("__call__", "__len__", "__repr__", "__eq__"):
            continue
        for arguments in ((), (ROWS,), (None,)):
            try:
                (member.fget if isinstance(member, property) else member)(cls.__new__(cls), *arguments)
            except (TypeError, af.InvalidInput, AttributeError):
                pass
bare = lambda cls: cls.__new__(cls)
refused(lambda: bare(af.DeformationField)(ROWS), "__init__")
refused(lambda: af.deform(bare(af.SurfaceSamples), things["handles"]), "__init__")
refused(lambda: af.sample_surface(bare(af.NeuralSdf)))
refused(lambda: af.deform(things["samples"], [bare(af.Point)]))
refused(lambda: af.arap_energy(bare(af.RadialField), ROWS), "__init__")
""")


def test_none_is_no_object():
    run("""
refused(lambda: af.sample_surface(None))
refused(lambda: af.extract_surface(None))
refused(lambda: af.extract_deformed(things["sdf"], None))
refused(lambda: af.deform(None, things["handles"]))
refused(lambda: af.deform(things["samples"], [None]))
refused(lambda: af.arap_energy(None, ROWS))
refused(lambda: af.distortion(None, ROWS))
refused(lambda: af.train_inverse(None, things["samples"]))
refused(lambda: af.LiveDeformer(None))
refused(lambda: things["live"].set_handles([None]))
""")


def test_arrays_that_cannot_be_copied_are_named():
    """Two billion rows that take no memory by themselves."""
    run("""
rows = np.broadcast_to(np.float32(0), (2_000_000_000, 3))
flat = np.broadcast_to(np.float32(0), (3_000_000_000,))
wide = np.broadcast_to(np.int32(0), (2_000_000_000, 3))
refused(lambda: af.signed_distance(rows, FACES, ROWS), "vertices")
refused(lambda: af.signed_distance(TETRAHEDRON, wide, ROWS), "triangles")
refused(lambda: af.winding_number(TETRAHEDRON, FACES, rows), "points")
refused(lambda: af.SurfaceSamples(rows, NORMALS), "points")
refused(lambda: af.Cuboid(rows, np.eye(4)), "rest")
refused(lambda: af.Point(flat, np.zeros(3)), "rest")
refused(lambda: things["sdf"](rows), "points")
refused(lambda: things["field"].inverse(rows), "points")
refused(lambda: af.gauss_preference(rows, np.eye(3)), "normals")
refused(lambda: af.NeuralSdf.from_layers([rows], [flat]), "weights")
refused(lambda: af.sample_curve(np.broadcast_to(0.0, (2_000_000_000, 2)), 10), "vertices")
""")


SIZES = [
    ("af.fit_sdf(TETRAHEDRON, FACES, af.FitOptions(near_points=10**9))", ["near_points", "memory"]),
    ("af.fit_sdf(TETRAHEDRON, FACES, af.FitOptions(uniform_points=10**9))", ["uniform_points", "memory"]),
    ("af.fit_sdf(TETRAHEDRON, FACES, af.FitOptions(width=8192, layers=64))", ["width", "memory"]),
    ("af.sample_mesh(TETRAHEDRON, FACES, 10**9)", ["count", "memory"]),
    ("af.sample_mesh(TETRAHEDRON, FACES, 2**62)", ["count", "memory"]),
    ("af.sample_surface(things['sdf'], 10**8)", ["count", "memory"]),
    ("af.sample_curve(ROWS[:, :2], 10**9)", ["count", "memory"]),
    ("af.sdf_grid(things['sdf'], 2048)", ["resolution", "memory"]),
    ("af.deform_curve(ROWS[:, :2], [af.CurveHandle([0])], af.CurveOptions(spacing=0.01))", ["spacing"]),
    (
        "af.deform_curve(np.random.default_rng(0).normal(size=(20000, 2)), [af.CurveHandle([0])],"
        " af.CurveOptions(spacing=0.02))",
        ["spacing", "memory"],
    ),
]


def test_sizes_that_memory_cannot_hold_are_named():
    run("\n".join(f"refused(lambda: {call}, *{words!r})" for call, words in SIZES))


def test_a_curve_hears_cancel():
    circle = np.stack([np.cos(np.linspace(0, 6, 400)), np.sin(np.linspace(0, 6, 400))], axis=1)
    task = af.Task()
    threading.Timer(0.2, task.cancel).start()
    with pytest.raises(af.Cancelled):
        af.deform_curve(circle, [af.CurveHandle([0])], af.CurveOptions(spacing=0.02), task=task)
    assert task.progress < 1.0


def test_a_sparse_file_asks_for_no_memory(tmp_path):
    """34 GB that are not there: refused by comparison with what is free."""
    header = {
        "__metadata__": {"format": "arapfields", "version": "1", "kind": "field", "report": "{}"},
        "centers": {"dtype": "F64", "shape": [1_400_000_000, 3], "data_offsets": [0, 33_600_000_000]},
    }
    structure = {
        "type": "radial",
        "centers": 1_400_000_000,
        "rest_points": 0,
        "frame": {"center": [0] * 3, "scale": 1},
    }
    header["__metadata__"]["structure"] = json.dumps(structure)
    path = tmp_path / "sparse"
    head = archives.joined(header, b"")
    path.write_bytes(head)
    os.truncate(path, len(head) + 33_600_000_000)
    code = (
        "import resource, sys; import arapfields as af\n"
        "resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))\n"
        "try: af.DeformationField.load(sys.argv[1])\n"
        "except af.InvalidInput as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True)
    assert done.returncode == 0 and "GiB" in done.stdout and str(path) in done.stdout, done


@pytest.mark.parametrize("far", [1e8, 1e30, 1e200])
@pytest.mark.parametrize("field", ["radial", "neural"])
def test_a_target_that_no_number_can_follow_is_refused(far, field):
    samples, rest = bar_samples(), np.diag([0.3, 0.6, 0.6, 1.0])
    target = rest.copy()
    target[0, 3] = far
    held = af.CuboidHandle(rest, rest)
    refused = (
        r"handles\[1\]: its target is .* times the shape's size away .*; at most 1e\+06 times is allowed"
    )
    options = {"iterations": 2, "width": 8, "layers": 1, "batch": 50}
    for moved in (af.CuboidHandle(rest, target), af.PointHandle([0, 0, 0], [0, 0, far])):
        with pytest.raises(af.InvalidInput, match=refused):
            af.deform(samples, [held, moved], af.DeformOptions(field=field, **options))
        with pytest.raises(af.InvalidInput, match=refused):
            style = af.StylizeOptions(field=field, **options)
            af.stylize(samples, "cube", style, handles=[held, moved])
    live = af.LiveDeformer(samples, [held], af.LiveOptions(samples=60, coarse_centers=4, fine_centers=8))
    with pytest.raises(af.InvalidInput, match=refused.replace("1", "0", 1)):
        live.solve([target])
    assert live.solve([rest]) is not None
