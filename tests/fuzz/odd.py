# SPDX-License-Identifier: GPL-3.0-or-later
"""Valid objects and invalid values for calls of the public interface."""

import numpy as np

import arapfields as af

from .mutate import FLOATS, NUMBERS

ROWS = np.random.default_rng(2).normal(size=(60, 3))
NORMALS = ROWS / np.linalg.norm(ROWS, axis=1, keepdims=True)
TETRAHEDRON = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
TINY = {"width": 8, "layers": 1, "octaves": 2, "threads": 1}
PLAIN = ("style_names", "backend", "simd_level", "thread_count", "device_report")
WRAP = {"centers": 20, "stages": 1, "iterations": 2}
CIRCLE = np.stack([np.cos(np.linspace(0, 6, 50)), np.sin(np.linspace(0, 6, 50))], axis=1)


def odd_arrays(rng):
    """Arrays with unexpected shapes, types, layouts and sizes."""
    n = int(rng.integers(0, 5))
    return [
        np.full((n, 3), np.nan),
        np.full((3, 3), 1e308),
        np.zeros((0, 3)),
        np.zeros((3, 0)),
        np.zeros(()),
        np.zeros((2, 3, 3)),
        np.ones((4, 3), np.float16),
        np.ones((4, 3), complex),
        np.ones((4, 3), object),
        np.ones((4, 3), bool),
        np.array([["a"] * 3] * 2),
        np.asfortranarray(rng.normal(size=(5, 3))),
        rng.normal(size=(10, 6))[::2, ::2],
        np.broadcast_to(np.zeros(3), (2_000_000_000, 3)),
        np.broadcast_to(np.float32(1), (3_000_000_000,)),
        rng.integers(-(2**62), 2**62, (4, 3)),
        np.arange(12, dtype=">i4").reshape(4, 3) % 4,
        np.full((2, 3), 5e-324),
        np.zeros((1, 3)),
        rng.normal(size=(4, 4)),
        rng.normal(size=(3, 3)),
    ]


def odd(rng, things):
    """An unexpected Python value."""
    kind = rng.integers(5)
    if kind == 0:
        arrays = odd_arrays(rng)
        return arrays[rng.integers(len(arrays))]
    if kind == 1:
        return [*NUMBERS, *FLOATS, 10**9, 10**12][rng.integers(len(NUMBERS) + len(FLOATS) + 2)]
    if kind == 2:
        values = [None, True, "", "x", "\ud800", b"x", [], {}, [None], object(), lambda x: x, 1j, range(3)]
        return values[rng.integers(len(values))]
    if kind == 3:
        chosen = rng.choice([value for value in vars(af._native).values() if isinstance(value, type)])
        try:
            return chosen.__new__(chosen)
        except TypeError:
            return chosen
    values = list(things.values())
    return values[rng.integers(len(values))]


def make_things():
    """{name: object} of each class, for calls and as arguments of wrong types."""
    samples = af.SurfaceSamples(ROWS, NORMALS)
    held, moved = np.eye(4), np.eye(4)
    moved[0, 3] = 0.1
    handles = [af.Point(ROWS[0], ROWS[0] + 0.1), af.Cuboid(held, moved)]
    field = af.deform(samples, handles[:1], af.DeformOptions(iterations=1, batch=10, **TINY))
    rng = np.random.default_rng(0)
    layers = [rng.normal(size=(b, a)) / a**0.5 for a, b in ((12, 8), (8, 1))]
    curve = af.sample_curve(CIRCLE, 40)
    wrapped = af.wrap(samples, af.MeshSdf(TETRAHEDRON, FACES), [], af.WrapOptions(**WRAP))
    return {
        "samples": samples,
        "handles": handles,
        "point": handles[0],
        "field": field,
        "sdf": af.NeuralSdf.from_layers(layers, [np.zeros(8), np.zeros(1)], octaves=2),
        "live": af.LiveDeformer(
            samples,
            handles[:1],
            af.LiveOptions(samples=50, coarse_centers=5, fine_centers=5, iterations=2, threads=1),
        ),
        "curve": curve,
        "curve_handle": af.CurveHandle([0, 1]),
        "task": af.Task(),
        "frame": field.frame,
        "mesh": (TETRAHEDRON, FACES),
        "mesh_sdf": af.MeshSdf(TETRAHEDRON, FACES),
        "wrapped": wrapped,
        "sequence": af.WrapSequence(samples, wrapped, af.WrapOptions(**WRAP)),
        "places": af.Correspondence(TETRAHEDRON, (TETRAHEDRON, FACES), (TETRAHEDRON, FACES)),
        "style": af.ObjectStyle(TETRAHEDRON, FACES),
        "attachment": af.Attachment(samples, ROWS[:5]),
        "curve_field": af.deform_curve(curve.points, [af.CurveHandle([0, 1])], af.CurveOptions(spacing=0.3)),
    }


def odd_options(rng, things, structure, **good):
    """Options with up to two invalid values; the alarm ends a long solve."""
    for _ in range(int(rng.integers(3))):
        names = structure.fields
        good[names[rng.integers(len(names))]] = odd(rng, things)
    return structure(**good)


def by_name(function, *names):
    """The function with its keyword arguments taken as last positional ones."""

    def call(*given):
        first = len(given) - len(names)
        return function(*given[:first], **dict(zip(names, given[first:], strict=True)))

    return call
