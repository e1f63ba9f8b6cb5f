# SPDX-License-Identifier: GPL-3.0-or-later
"""Calls of the public interface with arguments of which some are odd. What comes out is either a result or a
documented error, in the process that made the call."""

import numpy as np

import arapfields as af

from .mutate import FLOATS, NUMBERS

ROWS = np.random.default_rng(2).normal(size=(60, 3))
NORMALS = ROWS / np.linalg.norm(ROWS, axis=1, keepdims=True)
TETRAHEDRON = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
TINY = {"width": 8, "layers": 1, "octaves": 2, "threads": 1}
CIRCLE = np.stack([np.cos(np.linspace(0, 6, 50)), np.sin(np.linspace(0, 6, 50))], axis=1)


def odd_arrays(rng):
    """Arrays of other shapes, types, layouts and sizes than those that are asked for."""
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


class Bare:
    """Stands for an instance that __new__ alone has made."""


def odd(rng, things):
    """Any Python value that does not belong where it will be."""
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
    """One good object of each class, for calls and as arguments where they do not belong."""
    samples = af.SurfaceSamples(ROWS, NORMALS)
    held, moved = np.eye(4), np.eye(4)
    moved[0, 3] = 0.1
    handles = [af.Point(ROWS[0], ROWS[0] + 0.1), af.Cuboid(held, moved)]
    field = af.deform(samples, handles[:1], af.DeformOptions(iterations=1, batch=10, **TINY))
    rng = np.random.default_rng(0)
    layers = [rng.normal(size=(b, a)) / a**0.5 for a, b in ((12, 8), (8, 1))]
    curve = af.sample_curve(CIRCLE, 40)
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
    }


def deform_options(rng, things):
    return odd_options(rng, things, af.DeformOptions, iterations=2, batch=20, **TINY)


def odd_options(rng, things, structure, **good):
    """Options with up to two odd values; a long solve is ended by the alarm."""
    for _ in range(int(rng.integers(3))):
        names = structure.fields
        good[names[rng.integers(len(names))]] = odd(rng, things)
    return structure(**good)


def by_name(function, *names):
    """The function with its last arguments, which go by name, taken in order."""

    def call(*given):
        first = len(given) - len(names)
        return function(*given[:first], **dict(zip(names, given[first:], strict=True)))

    return call


def calls(rng, things):
    """{name: (function, arguments)}: all of the interface, each argument good."""
    t, task, moved = things, af.Task(), np.eye(4)
    fit = {"iterations": 2, "batch": 64, "near_points": 100, "uniform_points": 100, **TINY}
    live = {"samples": 50, "coarse_centers": 5, "fine_centers": 5, "iterations": 2, "threads": 1}
    return {
        "signed_distance": lambda: (
            by_name(af.signed_distance, "threads", "task"),
            [TETRAHEDRON, FACES, ROWS, 1, task],
        ),
        "winding_number": lambda: (
            by_name(af.winding_number, "threads", "task"),
            [TETRAHEDRON, FACES, ROWS, 1, task],
        ),
        "fit_sdf": lambda: (
            by_name(af.fit_sdf, "callback", "task"),
            [TETRAHEDRON, FACES, odd_options(rng, t, af.FitOptions, **fit), None, task],
        ),
        "from_layers": lambda: (
            af.NeuralSdf.from_layers,
            [[np.ones((8, 12)), np.ones((1, 8))], [np.ones(8), np.ones(1)], 2, 1.0, 30.0],
        ),
        "sdf": lambda: (t["sdf"], [ROWS]),
        "sdf.gradient": lambda: (t["sdf"].gradient, [ROWS]),
        "sample_mesh": lambda: (by_name(af.sample_mesh, "seed"), [TETRAHEDRON, FACES, 50, 0]),
        "sample_surface": lambda: (
            by_name(af.sample_surface, "seed", "threads", "task"),
            [t["sdf"], 20, 0, 1, task],
        ),
        "SurfaceSamples": lambda: (af.SurfaceSamples, [ROWS, NORMALS, t["frame"]]),
        "Cuboid": lambda: (af.Cuboid, [np.eye(4), moved, 1.0]),
        "Point": lambda: (af.Point, [ROWS[0], ROWS[1], 1.0]),
        "Region": lambda: (af.Region, [[0, 1], np.eye(4), moved, 1.0]),
        "Frame": lambda: (af.Frame, [ROWS[0], 1.0]),
        "Frame.to_cube": lambda: (t["frame"].to_cube, [ROWS]),
        "deform": lambda: (
            by_name(af.deform, "energies", "callback", "task"),
            [t["samples"], t["handles"], deform_options(rng, t), [], None, task],
        ),
        "stylize": lambda: (
            by_name(af.stylize, "weights", "handles", "orientation", "up", "energies", "callback", "task"),
            [
                t["samples"],
                "cube",
                odd_options(rng, t, af.StylizeOptions, iterations=2, batch=20, **TINY),
                *[np.ones(60), t["handles"][:1], np.eye(3), np.ones(3), [], None, task],
            ],
        ),
        "train_inverse": lambda: (
            by_name(af.train_inverse, "task"),
            [
                t["field"],
                t["samples"],
                odd_options(rng, t, af.InverseOptions, iterations=2, batch=20, **TINY),
                task,
            ],
        ),
        "field": lambda: (t["field"], [ROWS]),
        "field.jacobian": lambda: (t["field"].jacobian, [ROWS]),
        "field.hessian": lambda: (t["field"].hessian, [ROWS]),
        "field.inverse": lambda: (by_name(t["field"].inverse, "tolerance", "task"), [ROWS[:5], 1e-6, task]),
        "arap_energy": lambda: (af.arap_energy, [t["field"], ROWS]),
        "distortion": lambda: (af.distortion, [t["field"], ROWS]),
        "gauss_preference": lambda: (by_name(af.gauss_preference, "sharpness"), [NORMALS, np.eye(3), 5.0]),
        "style_sharpness": lambda: (af.style_sharpness, [NORMALS]),
        "preferred_normals": lambda: (af.preferred_normals, ["cube"]),
        "extract_surface": lambda: (by_name(af.extract_surface, "threads", "task"), [t["sdf"], 9, 1, task]),
        "extract_deformed": lambda: (
            by_name(af.extract_deformed, "inverse", "threads", "task"),
            [t["sdf"], t["field"], 9, None, 1, task],
        ),
        "LiveDeformer": lambda: (
            by_name(af.LiveDeformer, "task"),
            [t["samples"], t["handles"], odd_options(rng, t, af.LiveOptions, **live), task],
        ),
        "live.solve": lambda: (
            by_name(t["live"].solve, "iterations", "tolerance", "task"),
            [[ROWS[1]], 2, 0.1, task],
        ),
        "live.track": lambda: (t["live"].track, [ROWS]),
        "live.set_style": lambda: (
            by_name(t["live"].set_style, "sharpness", "weights", "up"),
            ["cube", 0.5, 5.0, np.ones(60), np.ones(3)],
        ),
        "live.set_handles": lambda: (t["live"].set_handles, [t["handles"][:1]]),
        "sample_curve": lambda: (by_name(af.sample_curve, "closed"), [CIRCLE, 50, True]),
        "CurveHandle": lambda: (af.CurveHandle, [[0, 1], np.eye(3), 1.0]),
        "deform_curve": lambda: (
            by_name(af.deform_curve, "task"),
            [
                t["curve"].points,
                [t["curve_handle"]],
                odd_options(rng, t, af.CurveOptions, threads=1, spacing=0.3),
                task,
            ],
        ),
        "Task.watch": lambda: (af.Task().watch, [ROWS, 0.1]),
        "Task.report": lambda: (af.Task().report, [0.5, "x"]),
        "sdf_grid": lambda: (
            by_name(af.sdf_grid, "bounds", "task"),
            [t["sdf"], 3, [[-1, -1, -1], [1, 1, 1]], task],
        ),
        "NeuralSdf.load": lambda: (af.NeuralSdf.load, ["/nonexistent"]),
        "DeformationField.load": lambda: (af.DeformationField.load, ["/nonexistent"]),
        "sdf.save": lambda: (t["sdf"].save, ["/nonexistent/x"]),
        "unbound": lambda: unbound(rng),
    }


def unbound(rng):
    """A method of a class, called on something that is no good instance of it."""
    native = [v for v in vars(af._native).values() if isinstance(v, type)]
    chosen = rng.choice([v for v in native if not issubclass(v, BaseException)])
    called = ("__call__", "__len__", "__repr__", "__eq__")
    names = [n for n in dir(chosen) if not n.startswith("__") or n in called]
    names = [n for n in names if n != "report"]  # an AttributeError, as of any attribute, where there is none
    member = getattr(chosen, names[rng.integers(len(names))])
    return getattr(member, "fget", member), [chosen.__new__(chosen), *[ROWS] * int(rng.integers(2))]


def case(rng, things):
    """(name, function, arguments): a call with up to three odd arguments."""
    known = calls(rng, things)
    name = sorted(known)[rng.integers(len(known))]
    function, arguments = known[name]()
    for _ in range(int(rng.integers(4))):
        if arguments:
            arguments[rng.integers(len(arguments))] = odd(rng, things)
    return name, function, arguments
