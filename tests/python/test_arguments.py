# SPDX-License-Identifier: GPL-3.0-or-later
"""Arguments: arrays from anywhere, objects of another type, and sizes that no memory holds."""

import array
import json
import os
import subprocess
import sys
import threading

import numpy as np
import pytest
from support.files import archives
from support.geometry import cases
from support.geometry.cases import bar_samples
from support.geometry.meshes import sphere

import arapfields as af

# Arrays from anywhere: what has the buffer protocol, DLPack, __array__, or is a nested sequence.

POINTS = np.random.default_rng(0).uniform(-1, 1, (40, 3))


@pytest.fixture(scope="module")
def field():
    options = af.DeformOptions(field="radial", iterations=3)
    return af.deform(cases.bar_samples(400), cases.bar_handles(), options)


class OnlyDLPack:
    """Shares a tensor's memory and has nothing else of an array."""

    def __init__(self, tensor):
        self._tensor = tensor

    def __dlpack__(self, **asked):
        return self._tensor.__dlpack__(**asked)

    def __dlpack_device__(self):
        return self._tensor.__dlpack_device__()


class OnlyArray:
    def __array__(self, dtype=None, copy=None):
        return POINTS


def kinds_of_points():
    import torch

    tensor = torch.tensor(POINTS)
    wide = torch.tensor(np.repeat(POINTS, 2, axis=1))
    return {
        "list": POINTS.tolist(),
        "tuples": tuple(map(tuple, POINTS)),
        "fortran": np.asfortranarray(POINTS),
        "strided": np.repeat(POINTS, 2, axis=0)[::2],
        "reversed": POINTS[::-1].copy()[::-1],
        "big_endian": POINTS.astype(">f8"),
        "buffer": memoryview(POINTS),
        "tensor": tensor,
        "tensor_with_gradient": tensor.clone().requires_grad_(),
        "tensor_of_an_operation": tensor.clone().requires_grad_() * 1.0,
        "strided_tensor": wide[:, ::2],
        "transposed_tensor": tensor.T.contiguous().T,
        "dlpack": OnlyDLPack(tensor),
        "array_protocol": OnlyArray(),
    }


@pytest.mark.parametrize("kind", kinds_of_points())
def test_equal_arrays_of_any_source_give_equal_results(field, kind):
    given = kinds_of_points()[kind]
    assert np.array_equal(field(given), field(POINTS))


def test_lower_precision_and_integers_are_the_numbers_that_they_are(field):
    import torch

    single = POINTS.astype(np.float32)
    assert np.array_equal(field(torch.tensor(single)), field(single.astype(float)))
    half = torch.tensor(single).half()
    assert np.array_equal(field(half), field(half.numpy().astype(float)))
    assert np.array_equal(field(torch.arange(12).reshape(4, 3)), field(np.arange(12.0).reshape(4, 3)))


def test_tensors_serve_every_kind_of_argument():
    import torch

    V, F = cases_mesh()
    tensors = torch.tensor(V), torch.tensor(np.asarray(F))
    assert np.array_equal(
        af.signed_distance(*tensors, torch.tensor(POINTS)), af.signed_distance(V, F, POINTS)
    )
    points = torch.tensor(af.sample_mesh(*tensors, 50).points)
    handle = af.RegionHandle(torch.arange(3), torch.eye(4), torch.eye(4))
    assert handle.samples == [0, 1, 2]
    turned = af.CuboidHandle(torch.eye(4, dtype=torch.float64), torch.eye(4).requires_grad_())
    assert np.array_equal(turned.target, np.eye(4))
    assert af.CurveHandle(array.array("q", [2, 5]), torch.eye(3)).samples == [2, 5]
    again = af.SurfaceSamples(points, points)
    assert np.allclose(again.points, points.numpy())
    assert np.array_equal(af.PointHandle([0, 0, 1], torch.zeros(3)).target, np.zeros(3))


def cases_mesh():
    return sphere(1.0, 2)


def refusals():
    import torch

    return {
        "complex": (torch.zeros(4, 3, dtype=torch.complex64), "complex64"),
        "bfloat16": (torch.zeros(4, 3, dtype=torch.bfloat16), "bfloat16|Unsupported|not supported"),
        "bool": (torch.zeros(4, 3, dtype=torch.bool), "bool"),
        "sparse": (torch.eye(3).to_sparse(), "torch.Tensor"),
        "meta": (torch.zeros(4, 3, device="meta"), "torch.Tensor"),
        "text": ("points", "str"),
        "ragged": ([[1, 2, 3], [4, 5]], "list"),
        "none": (None, "NoneType"),
        "set": ({1, 2, 3}, "set"),
    }


@pytest.mark.parametrize("kind", refusals())
def test_arguments_that_are_no_real_arrays_are_named(field, kind):
    given, word = refusals()[kind]
    with pytest.raises(af.InvalidInput, match=rf"^points: .*({word})"):
        field(given)


class Broken:
    def __array__(self, dtype=None, copy=None):
        raise MemoryError("out of it")


def test_an_object_that_fails_while_it_is_converted_is_named(field):
    with pytest.raises(af.InvalidInput, match=r"^points: .*Broken.*out of it"):
        field(Broken())


class Interrupted:
    def __array__(self, dtype=None, copy=None):
        raise KeyboardInterrupt


def test_ctrl_c_in_a_conversion_raises_keyboard_interrupt(field):
    with pytest.raises(KeyboardInterrupt):
        field(Interrupted())


SCRIPT = """
import resource, numpy as np, arapfields as af
samples = af.SurfaceSamples(np.eye(3), np.eye(3))
live = af.LiveDeformer(samples, [af.PointHandle([1, 0, 0], [1, 0, 0])], af.LiveOptions(fine_centers=5))
options = af.DeformOptions(iterations=1, width=8, layers=1)
pages = int(open("/proc/self/statm").read().split()[0])
limit = pages * resource.getpagesize() + (1 << 30)
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
rows = np.broadcast_to(np.float32(0), (2_000_000_000, 3))
flat = np.broadcast_to(np.int64(0), (2_000_000_000,))
handle = np.empty((), object)
handle[()] = af.PointHandle([1, 0, 0], [1, 0, 0])
handles = np.broadcast_to(handle, (2_000_000_000,))
for argument, call in {CALLS}:
    try:
        call()
    except af.InvalidInput as error:
        assert str(error).startswith(argument), (argument, error)
    else:
        raise AssertionError(argument)
"""

CALLS = """[
    ("samples", lambda: af.CurveHandle(flat)),
    ("samples", lambda: af.CurveHandle(rows)),
    ("samples", lambda: af.RegionHandle(flat, np.eye(4), np.eye(4))),
    ("handles[0]", lambda: af.LiveDeformer(samples, rows)),
    ("handles", lambda: af.LiveDeformer(samples, handles)),
    ("handles[0]", lambda: live.set_handles(rows)),
    ("handles", lambda: live.set_handles(handles)),
    ("handles[0]", lambda: af.deform(samples, rows, options)),
    ("handles", lambda: af.deform(samples, handles, options)),
    ("handles[0]", lambda: af.deform_curve(np.eye(2), rows)),
    ("handles[0]", lambda: af.stylize(samples, "cube", handles=rows)),
    ("targets", lambda: live.solve(rows)),
    ("weights", lambda: af.stylize(samples, "cube", weights=flat)),
    ("energies[0]", lambda: af.deform(samples, [handle[()]], options, energies=rows)),
    ("weights", lambda: af.NeuralSdf.from_layers(rows[:, :, None], [np.zeros(1)])),
    ("weights", lambda: af.NeuralSdf.from_layers(np.broadcast_to(0.0, (2_000_000_000, 1, 1)), [np.zeros(1)])),
    ("points", lambda: af.SurfaceSamples(rows, np.eye(3))),
]"""


def test_no_argument_asks_for_memory_that_is_not_there():
    """Sequences two billion long, in a process that has one gigabyte."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.replace("{CALLS}", CALLS)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-3000:]


def test_items_that_do_not_belong_are_named():
    samples = cases.bar_samples(100)
    good = cases.bar_handles()
    for handles, name in [
        ([*good, 5], r"handles\[2\].*int"),
        (5, "handles: .*int"),
        ("ab", r"handles\[0\].*str"),
    ]:
        with pytest.raises(af.InvalidInput, match=r"^" + name):
            af.deform(samples, handles)
    assert af.LiveDeformer(samples, (handle for handle in good)).solve()(POINTS).shape == (40, 3)


@pytest.mark.parametrize("biases", [[np.zeros(()), np.zeros(())], np.zeros(()), 3, [np.zeros(8)], None])
def test_layers_without_biases_that_fit_are_refused(biases):
    weights = [np.ones((8, 12)), np.ones((1, 8))]
    with pytest.raises(af.InvalidInput, match=r"^(biases|weights)"):
        af.NeuralSdf.from_layers(weights, biases, octaves=2)


@pytest.mark.parametrize("method", ["to_dict", "__repr__"])
def test_methods_of_options_on_something_else_are_type_errors(method):
    with pytest.raises(TypeError, match=r"DeformOptions: got .*int"):
        getattr(af.DeformOptions, method)(5)
    with pytest.raises(TypeError):
        af.DeformOptions.bending.fget(5)


# What is of another type, and what no handle may have, is named where it enters.

WRONG = ["x", None, 1.5, 3, True, b"", object(), [], {}, 1j, np.array("2020-01-01", "datetime64[D]"), 10**30]
CORNERS = np.eye(3)
SAMPLES = af.SurfaceSamples(CORNERS, CORNERS)
TRIANGLES = [[0, 1, 2]]
FIELD = af.LiveDeformer(
    SAMPLES,
    [af.PointHandle([1, 0, 0], [1, 0, 0])],
    af.LiveOptions(samples=10, fine_centers=5, coarse_centers=2),
)

TYPED_CALLS = {
    "count": lambda x: af.sample_mesh(CORNERS, TRIANGLES, x),
    "seed": lambda x: af.sample_mesh(CORNERS, TRIANGLES, 10, seed=x),
    "threads": lambda x: af.signed_distance(CORNERS, TRIANGLES, CORNERS, threads=x),
    "task": lambda x: af.signed_distance(CORNERS, TRIANGLES, CORNERS, task=x),
    "resolution": lambda x: af.extract_surface(af.MeshSdf(CORNERS, TRIANGLES), x),
    "refine_thin": lambda x: af.extract_surface(af.MeshSdf(CORNERS, TRIANGLES), 9, refine_thin=x),
    "sdf": lambda x: af.extract_surface(x),
    "frame": lambda x: af.SurfaceSamples(CORNERS, CORNERS, x),
    "scale": lambda x: af.Frame([0, 0, 0], x),
    "fraction": lambda x: af.Task().report(x),
    "message": lambda x: af.Task().report(0.0, x),
    "samples": lambda x: af.deform(x, []),
    "options": lambda x: af.deform(SAMPLES, [], x),
    "field": lambda x: af.distortion(x, CORNERS),
    "iterations": lambda x: FIELD.solve(iterations=x),
    "tolerance": lambda x: FIELD.solve(tolerance=x),
    "seconds": lambda x: FIELD.step(None, x),
    "symmetry": lambda x: FIELD.set_symmetry(x),
    "weight": lambda x: af.PointHandle([0, 0, 0], [0, 0, 0], x),
    "allow_scale": lambda x: af.CuboidHandle(np.eye(4), np.eye(4), allow_scale=x),
    "strength": lambda x: FIELD.solve().apply(CORNERS, strength=x),
    "closed": lambda x: af.sample_curve(np.eye(2), 9, closed=x),
}


@pytest.mark.parametrize("name", TYPED_CALLS)
def test_wrong_types_are_invalid_input_that_names_the_argument(name):
    refused = 0
    for value in WRONG:
        try:
            TYPED_CALLS[name](value)
        except af.InvalidInput as error:
            refused += str(error).startswith(f"{name}: ")
            assert "incompatible function arguments" not in str(error)
    assert refused >= 4


def test_a_wrong_type_is_a_type_error_too():
    with pytest.raises(TypeError, match=r"count: got .*str.*an integer is needed") as error:
        af.sample_mesh(CORNERS, TRIANGLES, "x")
    assert isinstance(error.value, af.InvalidInput)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: af.sample_mesh(CORNERS), "triangles: is missing"),
        (
            lambda: af.sample_mesh(CORNERS, TRIANGLES, sede=1),
            "sede: there is no such argument; sample_mesh() takes",
        ),
        (lambda: af.sample_mesh(CORNERS, TRIANGLES, vertices=CORNERS), "vertices: is given twice"),
        (lambda: af.Task().cancel(3), "arguments: there are too many; cancel() takes nothing"),
        (lambda: af.Task.cancel(None), "self: got"),
        (lambda: af.LiveDeformer(), "samples: is missing"),
        (lambda: FIELD.solve(steps=3), "steps: there is no such argument; solve() takes"),
    ],
)
def test_missing_and_unknown_arguments_are_named(call, says):
    with pytest.raises(af.InvalidInput) as error:
        call()
    assert str(error.value).startswith(says) and isinstance(error.value, TypeError)


@pytest.mark.parametrize("weight", [0.0, -1.0, np.nan, np.inf])
def test_weights_are_checked_where_they_enter(weight):
    for make in (
        lambda: af.PointHandle([0, 0, 0], [0, 0, 0], weight),
        lambda: af.CuboidHandle(np.eye(4), np.eye(4), weight),
        lambda: af.RegionHandle([0], np.eye(4), np.eye(4), weight),
        lambda: af.CurveHandle([0], weight=weight),
    ):
        with pytest.raises(af.InvalidInput, match="weight"):
            make()


def test_indices_and_motions_are_checked_where_they_enter():
    with pytest.raises(af.InvalidInput, match=r"samples: -1"):
        af.RegionHandle([-1], np.eye(4), np.eye(4))
    with pytest.raises(af.InvalidInput, match=r"samples: -1"):
        af.CurveHandle([-1])
    for motion in (2 * np.eye(3), np.diag([1.0, -1.0, 1.0]), np.full((3, 3), np.nan)):
        with pytest.raises(af.InvalidInput, match="motion"):
            af.CurveHandle([0], motion)


# Arguments that could end the process or take all memory: in processes with limits.

PRELUDE = """
import resource, sys, numpy as np, arapfields as af
from pathlib import Path
sys.path[:0] = TESTS, ROOT
from fuzz.calls import make_things, TETRAHEDRON, FACES, ROWS, NORMALS
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


def test_none_is_refused_as_an_object():
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
