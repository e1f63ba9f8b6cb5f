# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays from anywhere: what has the buffer protocol, DLPack, __array__, or is a nested sequence."""

import array
import subprocess
import sys

import numpy as np
import pytest
from support.geometry import cases
from support.geometry.meshes import sphere

import arapfields as af

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
def test_the_same_numbers_give_the_same_result_wherever_they_come_from(field, kind):
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
def test_what_is_no_array_of_real_numbers_is_refused_by_name(field, kind):
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


def test_ctrl_c_in_a_conversion_stays_what_it_is(field):
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
