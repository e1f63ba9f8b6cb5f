# SPDX-License-Identifier: GPL-3.0-or-later
"""Calls of the public interface with some invalid arguments, which return or raise a documented error."""

import types
from functools import partial

import numpy as np

import arapfields as af

from .mutate import FLOATS, NUMBERS

# Calls of the public interface with some invalid arguments, which must return a result or raise a
# documented error.

LEFT_OUT = {  # {public callable that is not fuzzed: reason}
    "ImplicitFunction": "a base for Python: tests/python/test_implicit_function.py",
    "ImplicitFunction.__call__": "likewise: classes of ours have their own",
    "ImplicitFunction.gradient": "likewise: classes of ours have their own",
    "Energy.__call__": "a base for Python: tests/python/test_external_energies.py",
    "cmake_dir": "a path of the installation, without arguments",
    "skin_weights": "seconds a call: tests/python/test_skin.py",
    "skin_correctives": "seconds a call: tests/python/test_skin.py",
    "Corrective.value": "of what skin_correctives returns",
    "RadialField.arrays": "without arguments: tests/python/test_fields.py",
    "LiveDeformer.reset": "without arguments; it would undo what other calls have set up",
    "PointCacheReader.close": "without arguments, after a reader that the file of each case gives",
}


def public_callables():
    """Names of all functions, constructible classes and members of the package."""
    for name, value in vars(af).items():
        if not callable(value):
            continue
        if name.startswith("_") or isinstance(value, types.ModuleType) or hasattr(value, "__origin__"):
            continue
        if not isinstance(value, type):
            yield name
        elif value.__name__ == name and not is_plain(value):
            if "No constructor" not in initializer(value) and "Initialize self" not in initializer(value):
                yield name
            yield from (f"{name}.{member}" for member in called_members(value))


def is_plain(cls):
    """Whether a class is an error or plain data."""
    return issubclass(cls, BaseException | tuple) or hasattr(cls, "__dataclass_fields__")


def initializer(cls):
    return cls.__init__.__doc__ or ""


def called_members(cls):
    for name, member in vars(cls).items():
        is_public = name == "__call__" or not name.startswith("_")
        if is_public and not isinstance(member, property) and callable(getattr(cls, name)):
            yield name


def unbound(rng):
    """A method of a class, called on an object that is no valid instance."""
    native = [v for v in vars(af._native).values() if isinstance(v, type)]
    chosen = rng.choice([v for v in native if not issubclass(v, BaseException)])
    called = ("__call__", "__len__", "__repr__", "__eq__")
    names = [n for n in dir(chosen) if not n.startswith("__") or n in called]
    names = [n for n in names if n != "report"]  # raises AttributeError if there is none
    member = getattr(chosen, names[rng.integers(len(names))])
    return getattr(member, "fget", member), [chosen.__new__(chosen), *[ROWS] * int(rng.integers(2))]


def case(rng, things):
    """(name, function, arguments) of a call with up to three invalid arguments."""
    known = calls(rng, things) | splat_calls(things) | {"unbound": lambda: unbound(rng)}
    name = sorted(known)[rng.integers(len(known))]
    function, arguments = known[name]()
    for _ in range(int(rng.integers(4))):
        if arguments:
            arguments[rng.integers(len(arguments))] = odd(rng, things)
    return name, function, arguments


# Calls of the public interface with valid objects and invalid values.

# Valid objects and invalid values for calls of the public interface.

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


# Valid calls of the public interface by name of function, class or member.


def calls(rng, things):
    """{name: (function, valid arguments)} of the whole interface."""
    t, task, moved = things, af.Task(), np.eye(4)
    fit = {"iterations": 2, "batch": 64, "near_points": 100, "uniform_points": 100, **TINY}
    live = {"samples": 50, "coarse_centers": 5, "fine_centers": 5, "iterations": 2, "threads": 1}
    return (
        options(rng, t)
        | members(t)
        | live_calls(t)
        | {
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
            "NeuralSdf.from_layers": lambda: (
                af.NeuralSdf.from_layers,
                [[np.ones((8, 12)), np.ones((1, 8))], [np.ones(8), np.ones(1)], 2, 1.0, 30.0],
            ),
            "NeuralSdf.__call__": lambda: (t["sdf"], [ROWS]),
            "NeuralSdf.gradient": lambda: (t["sdf"].gradient, [ROWS]),
            "sample_mesh": lambda: (by_name(af.sample_mesh, "seed"), [TETRAHEDRON, FACES, 50, 0]),
            "sample_surface": lambda: (
                by_name(af.sample_surface, "seed", "threads", "task"),
                [t["sdf"], 20, 0, 1, task],
            ),
            "SurfaceSamples": lambda: (af.SurfaceSamples, [ROWS, NORMALS, t["frame"]]),
            "CuboidHandle": lambda: (af.Cuboid, [np.eye(4), moved, 1.0]),
            "PointHandle": lambda: (af.Point, [ROWS[0], ROWS[1], 1.0]),
            "RegionHandle": lambda: (af.Region, [[0, 1], np.eye(4), moved, 1.0]),
            "Frame": lambda: (af.Frame, [ROWS[0], 1.0]),
            "Frame.to_cube": lambda: (t["frame"].to_cube, [ROWS]),
            "deform": lambda: (
                by_name(af.deform, "energies", "callback", "task"),
                [
                    t["samples"],
                    t["handles"],
                    odd_options(rng, t, af.DeformOptions, iterations=2, batch=20, **TINY),
                    [],
                    None,
                    task,
                ],
            ),
            "stylize": lambda: (
                by_name(
                    af.stylize, "weights", "handles", "orientation", "up", "energies", "callback", "task"
                ),
                [
                    t["samples"],
                    "cube",
                    odd_options(rng, t, af.StylizeOptions, iterations=2, batch=20, **TINY),
                    *[np.ones(60), t["handles"][:1], np.eye(3), np.ones(3), [], None, task],
                ],
            ),
            "sharpen": lambda: (
                by_name(af.sharpen, "weights", "orientation", "up", "contact", "task"),
                [
                    TETRAHEDRON,
                    FACES,
                    TETRAHEDRON,
                    "cube",
                    odd_options(rng, t, af.SharpenOptions, iterations=2, threads=1),
                    *[np.ones(len(TETRAHEDRON)), np.eye(3), np.ones(3), af.Contact(ground=-1.0), task],
                ],
            ),
            "folded_triangles": lambda: (af.folded_triangles, [TETRAHEDRON, FACES, TETRAHEDRON]),
            "train_inverse": lambda: (
                by_name(af.train_inverse, "task"),
                [
                    t["field"],
                    t["samples"],
                    odd_options(rng, t, af.InverseOptions, iterations=2, batch=20, **TINY),
                    task,
                ],
            ),
            "DeformationField.__call__": lambda: (t["field"], [ROWS]),
            "DeformationField.jacobian": lambda: (t["field"].jacobian, [ROWS]),
            "DeformationField.hessian": lambda: (t["field"].hessian, [ROWS]),
            "DeformationField.inverse": lambda: (
                by_name(t["field"].inverse, "tolerance", "task"),
                [ROWS[:5], 1e-6, task],
            ),
            "arap_energy": lambda: (af.arap_energy, [t["field"], ROWS]),
            "distortion": lambda: (af.distortion, [t["field"], ROWS]),
            "gauss_preference": lambda: (
                by_name(af.gauss_preference, "sharpness"),
                [NORMALS, np.eye(3), 5.0],
            ),
            "style_sharpness": lambda: (af.style_sharpness, [NORMALS]),
            "preferred_normals": lambda: (af.preferred_normals, ["cube"]),
            "extract_surface": lambda: (
                by_name(af.extract_surface, "threads", "task"),
                [t["sdf"], 9, 1, task],
            ),
            "extract_deformed": lambda: (
                by_name(af.extract_deformed, "inverse", "threads", "task"),
                [t["sdf"], t["field"], 9, None, 1, task],
            ),
            "LiveDeformer": lambda: (
                by_name(af.LiveDeformer, "task"),
                [t["samples"], t["handles"], odd_options(rng, t, af.LiveOptions, **live), task],
            ),
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
            "NeuralSdf.save": lambda: (t["sdf"].save, ["/nonexistent/x"]),
        }
    )


def live_calls(t):
    task, live = af.Task(), t["live"]
    return {
        "LiveDeformer.solve": lambda: (
            by_name(live.solve, "iterations", "tolerance", "task"),
            [[ROWS[1]], 2, 0.1, task],
        ),
        "LiveDeformer.track": lambda: (live.track, [ROWS]),
        "LiveDeformer.set_style": lambda: (
            by_name(live.set_style, "sharpness", "weights", "up"),
            ["cube", 0.5, 5.0, np.ones(60), np.ones(3)],
        ),
        "LiveDeformer.set_handles": lambda: (live.set_handles, [t["handles"][:1]]),
        "LiveDeformer.follow": lambda: (
            by_name(live.follow, "iterations", "tolerance", "task"),
            [[ROWS[1]], 2, 0.1, task],
        ),
        "LiveDeformer.step": lambda: (
            by_name(live.step, "coordinates", "task"),
            [[ROWS[1]], 0.01, None, task],
        ),
        "LiveDeformer.tracked": lambda: (live.tracked, []),
        "LiveDeformer.set_weights": lambda: (live.set_weights, [np.ones(60), np.ones(60)]),
        "LiveDeformer.set_symmetry": lambda: (by_name(live.set_symmetry, "task"), ["x", task]),
        "LiveDeformer.set_secondary_motion": lambda: (
            by_name(live.set_secondary_motion, "masses", "up", "ground"),
            [af.SecondaryMotionOptions(), np.ones(60), np.ones(3), -2.0],
        ),
    }


def options(rng, things):
    """Calls of each options class: constructor, presets, values."""
    named = {}
    for name, cls in vars(af).items():
        if not name.endswith("Options") or cls.__name__ != name:  # an alias
            continue
        named[name] = lambda cls=cls: (partial(odd_options, rng, things, cls), [])
        named[f"{name}.to_dict"] = lambda cls=cls: (cls.to_dict, [cls()])
        if hasattr(cls, "preset"):
            named[f"{name}.preset"] = lambda cls=cls: (cls.preset, ["paper"])
    return named


def members(t):
    """Calls of members of objects, and of functions with few arguments."""
    writer = af.PointCacheWriter
    moved = ROWS + 0.1

    def wrapping(third):
        return [t["samples"], t["mesh_sdf"], third, af.WrapOptions(**WRAP), af.Task()]

    return {
        "MeshSdf": lambda: (by_name(af.MeshSdf, "task"), [TETRAHEDRON, FACES, af.Task()]),
        "MeshSdf.__call__": lambda: (t["mesh_sdf"], [ROWS]),
        "MeshSdf.gradient": lambda: (t["mesh_sdf"].gradient, [ROWS]),
        "MeshSdf.save": lambda: (t["mesh_sdf"].save, ["/nonexistent/x"]),
        "ObjectStyle": lambda: (by_name(af.ObjectStyle, "task"), [TETRAHEDRON, FACES, af.Task()]),
        "ObjectStyle.normals": lambda: (t["style"].normals, [NORMALS]),
        "ObjectStyle.turned": lambda: (t["style"].turned, [np.eye(3)]),
        "Attachment": lambda: (by_name(af.Attachment, "task"), [t["samples"], ROWS[:5], af.Task()]),
        "Attachment.positions": lambda: (t["attachment"].positions, [t["field"]]),
        "CurveField.__call__": lambda: (t["curve_field"], [ROWS]),
        "CurveField.jacobian": lambda: (t["curve_field"].jacobian, [ROWS]),
        "DeformationField.apply": lambda: (by_name(t["field"].apply, "strength"), [ROWS, 0.5]),
        "DeformationField.save": lambda: (t["field"].save, ["/nonexistent/x"]),
        "Frame.to_mesh": lambda: (t["frame"].to_mesh, [ROWS]),
        "SurfaceSamples.with_weights": lambda: (t["samples"].with_weights, [np.ones(60), np.ones(60)]),
        "Bone": lambda: (
            by_name(af.Bone, "deform", "limits", "name"),
            [np.zeros(3), np.ones(3), None, 0.0, True, np.zeros((3, 2)), "spine"],
        ),
        "coincident_bones": lambda: (af.coincident_bones, [[af.Bone(np.zeros(3), np.ones(3))] * 2]),
        "bone_handles": lambda: (af.bone_handles, [t["samples"], [af.Bone(np.zeros(3), np.ones(3))]]),
        "skin": lambda: (af.skin, [ROWS, np.ones((60, 1)), [np.eye(4)], "linear"]),
        "Task": lambda: (af.Task, []),
        "Task.cancel": lambda: (af.Task.cancel, [af.Task()]),
        "rigid_motion": lambda: (by_name(af.rigid_motion, "weights"), [ROWS, moved, np.ones(60)]),
        "sample_meshes": lambda: (
            by_name(af.sample_meshes, "seed", "weights", "bend_weights"),
            [[(TETRAHEDRON, FACES)], 50, 0, None, None],
        ),
        "save_grid": lambda: (af.save_grid, ["grid.npz", np.zeros((3, 3, 3)), np.zeros(3), 0.1]),
        "wrap": lambda: (by_name(af.wrap, "task"), wrapping([])),
        "suggest_landmarks": lambda: (by_name(af.suggest_landmarks, "task"), wrapping(4)),
        "WrapSequence": lambda: (af.WrapSequence, [t["samples"], t["wrapped"], af.WrapOptions(**WRAP)]),
        "WrapSequence.next": lambda: (by_name(t["sequence"].next, "task"), [t["mesh_sdf"], af.Task()]),
        "Obstacle": lambda: (by_name(af.Obstacle, "placement"), [t["mesh_sdf"], 0.1, np.eye(4)]),
        "Contact": lambda: (
            by_name(af.Contact, "ground", "up"),
            [[af.Obstacle(t["mesh_sdf"])], 0.0, np.ones(3)],
        ),
        "LiveDeformer.set_contact": lambda: (t["live"].set_contact, [af.Contact(ground=-1.0)]),
        "Correspondence": lambda: (
            by_name(af.Correspondence, "back"),
            [TETRAHEDRON, *[t["mesh"]] * 2, False],
        ),
        "Correspondence.values": lambda: (t["places"].values, [TETRAHEDRON]),
        "Correspondence.displacements": lambda: (t["places"].displacements, [TETRAHEDRON]),
        "transfer": lambda: (af.transfer, [TETRAHEDRON, t["mesh"], t["mesh"], {"values": TETRAHEDRON}]),
        "PointCacheReader": lambda: (af.PointCacheReader, ["/nonexistent"]),
        "PointCacheWriter": lambda: (by_name(writer, "start", "step"), ["/none/x.pc2", 4, 2, 1.0, 1.0]),
        "PointCacheWriter.write": lambda: (lambda *given: with_writer("write", *given), [TETRAHEDRON]),
        "PointCacheWriter.finish": lambda: (lambda: with_writer("finish"), []),
        "PointCacheWriter.commit": lambda: (lambda: with_writer("commit"), []),
        "PointCacheWriter.discard": lambda: (lambda: with_writer("discard"), []),
        **{name: partial(lambda name: (getattr(af, name), []), name) for name in PLAIN},
    }


def with_writer(member, *given):
    """A call of a member of a cache writer, with one frame of four points, which leaves no file."""
    writer = af.PointCacheWriter("motion.pc2", 4, 1)
    try:
        getattr(writer, member)(*given)
    finally:
        writer.discard()


SPLAT_ROWS = (ROWS, np.tile([1.0, 0, 0, 0], (len(ROWS), 1)), np.full((len(ROWS), 3), 0.1))
SPLATS_GIVEN = [*SPLAT_ROWS, np.full(len(ROWS), 0.9), np.zeros((len(ROWS), 4, 3))]
SPLAT_NUMBERS = (4 + 12, len(ROWS))  # numbers per splat that a motion changes


def splat_calls(things):
    """{name: (function, valid arguments)} of functions of splats."""
    splats = af.GaussianSplats(*SPLATS_GIVEN)
    return {
        "GaussianSplats": lambda: (af.GaussianSplats, list(SPLATS_GIVEN)),
        "GaussianSplats.save": lambda: (by_name(splats.save, "task"), ["/nonexistent/x", af.Task()]),
        "GaussianSplats.save_gltf": lambda: (
            by_name(splats.save_gltf, "up", "task"),
            ["/nonexistent/x", "name", "z", af.Task()],
        ),
        "GaussianSplats.transformed": lambda: (
            by_name(splats.transformed, "task"),
            [[[2, 0, 0, 1], [0, 3, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], af.Task()],
        ),
        "GaussianSplats.load": lambda: (by_name(af.GaussianSplats.load, "task"), ["/nonexistent", af.Task()]),
        "GaussianSplats.is_file": lambda: (af.GaussianSplats.is_file, ["/nonexistent"]),
        "DeformationField.apply_to": lambda: (
            by_name(things["field"].apply_to, "max_stretch", "task"),
            [splats, 2.0, af.Task()],
        ),
        "PreparedSplats": lambda: (af.PreparedSplats, [splats]),
        "PreparedSplats.moved": lambda: (
            by_name(af.PreparedSplats(splats).moved, "max_stretch", "task"),
            [things["field"], af.GaussianSplats(*SPLATS_GIVEN), 2.0, af.Task()],
        ),
        "PreparedSplats.changes": lambda: (
            by_name(af.PreparedSplats(splats).changes, "task"),
            [things["field"], [*np.ones(SPLAT_NUMBERS, "f4")], [*np.ones(SPLAT_NUMBERS, "f4")], af.Task()],
        ),
        "sample_splats": lambda: (by_name(af.sample_splats, "task"), [splats, 30, af.Task()]),
    }
