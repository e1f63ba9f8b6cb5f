# SPDX-License-Identifier: GPL-3.0-or-later
"""Every pair of methods of each bound class from two threads: each answer is that of some order of calls."""

import contextlib
import itertools
import random
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import arapfields as af
from arapfields import _native

RNG = np.random.default_rng(2)
BALL = RNG.normal(size=(150, 3))
BALL /= np.linalg.norm(BALL, axis=1, keepdims=True)
SAMPLES = af.SurfaceSamples(BALL, BALL)
POINTS = 0.9 * BALL[:20]
SPLATS = af.GaussianSplats(
    POINTS, np.eye(4)[[0] * 20], np.full((20, 3), 0.1), np.full(20, 0.5), np.zeros((20, 4, 3))
)
TETRAHEDRON = (
    np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]]),
    [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]],
)
SMALL = af.LiveOptions(samples=60, coarse_centers=4, fine_centers=12, iterations=2, interior=False, threads=1)
DOCUMENTED = (af.InvalidInput, af.Cancelled, OSError, AttributeError)


def splat_changes(prepared):
    rest, changes = np.ones((4 + 12, len(SPLATS)), np.float32), np.zeros((4 + 12, len(SPLATS)), np.float32)
    return prepared.changes(MOVED, [*rest], [*changes]), changes


def pose(x):
    return [[0, 0, -1.0], [x, 0, 1.0]]


def pins(x=0.0):
    return [af.PointHandle([0, 0, -1], [0, 0, -1]), af.PointHandle([0, 0, 1], [x, 0, 1])]


def live():
    solver = af.LiveDeformer(SAMPLES, pins(), SMALL)
    solver.track(POINTS)
    return solver


MOVED = live().solve(pose(0.2))
STATE = live().motion_state
COARSE = af.WrapOptions(centers=10, stages=1, iterations=1, threads=1)
WRAPPED = af.wrap(SAMPLES, af.MeshSdf(*TETRAHEDRON), [], COARSE)


class Ball(af.ImplicitFunction):
    def __call__(self, points):
        return np.linalg.norm(points, axis=1) - 0.5


def network():
    sizes = [(8, 12), (8, 8), (1, 8)]
    rng = np.random.default_rng(4)
    return af.NeuralSdf.from_layers(
        [rng.normal(size=size) for size in sizes], [np.zeros(n) for n, _ in sizes], octaves=2
    )


def assign(name, value):
    return lambda it: setattr(it, name, value)


def changes_under_way(name, calls):
    """Whether a call reads a value that another one changes while it runs: a task's progress."""
    return name == "Task" and bool({"serve", "deform"} & set(calls))


FIELD = {
    "__call__": lambda it: it(POINTS),
    "apply": lambda it: it.apply(POINTS),
    "apply_to": lambda it: it.apply_to(SPLATS).centers,
    "jacobian": lambda it: it.jacobian(POINTS),
    "hessian": lambda it: it.hessian(POINTS),
    "inverse": lambda it: it.inverse(POINTS[:4]),
}
DISTANCE = {"__call__": lambda it: it(POINTS), "gradient": lambda it: it.gradient(POINTS)}

# {class: (function that makes an object, {name: call}, without reads of properties)}
CLASSES = {
    "LiveDeformer": (
        live,
        {
            "solve": lambda it: it.solve(pose(0.2)),
            "solve as it is": lambda it: it.solve(),
            "follow": lambda it: it.follow(pose(-0.2)),
            "step": lambda it: it.step(pose(0.1), 0.04),
            "track": lambda it: it.track(POINTS[:5]),
            "tracked": lambda it: it.tracked(),
            "set_handles": lambda it: it.set_handles(pins()[:1]),
            "set_weights": lambda it: it.set_weights(np.linspace(1, 2, len(BALL))),
            "set_symmetry": lambda it: it.set_symmetry("x"),
            "set_style": lambda it: it.set_style("cube", 1.0),
            "set_contact": lambda it: it.set_contact(None),
            "set_secondary_motion": lambda it: it.set_secondary_motion(),
            "set motion_state": assign("motion_state", STATE),
            "reset": lambda it: it.reset(),
        },
    ),
    "Task": (
        af.Task,
        {
            "cancel": lambda it: it.cancel(),
            "report": lambda it: it.report(0.5, "half"),
            "watch": lambda it: it.watch(POINTS),
            "serve": lambda it: af.winding_number(*TETRAHEDRON, POINTS, task=it),
            "deform": lambda it: af.deform(
                SAMPLES, pins(0.2), af.DeformOptions(field="radial", iterations=2), task=it
            ),
        },
    ),
    "NeuralSdf": (network, {**DISTANCE, "sample": lambda it: it.layers[0][0]}),
    "MeshSdf": (lambda: af.MeshSdf(*TETRAHEDRON), DISTANCE),
    "ImplicitFunction": (Ball, {**DISTANCE, "extract": lambda it: af.extract_surface(it, 8).vertices}),
    "SurfaceSamples": (
        lambda: SAMPLES.with_weights(),
        {
            "with_weights": lambda it: it.with_weights(np.ones(len(BALL))).weights,
            "__len__": len,
            "__repr__": repr,
        },
    ),
    "Frame": (
        lambda: af.Frame([0, 0, 1], 2.0),
        {"to_cube": lambda it: it.to_cube(POINTS), "to_mesh": lambda it: it.to_mesh(POINTS)},
    ),
    "DeformationField": (
        lambda: af.deform(SAMPLES, pins(0.1), af.DeformOptions(iterations=2, width=8, layers=1)),
        FIELD,
    ),
    "RadialField": (
        lambda: live().solve(pose(0.2)),
        {**FIELD, "arrays": lambda it: list(it.arrays().values())},
    ),
    "MotionState": (lambda: live().motion_state, {}),
    "Attachment": (
        lambda: af.Attachment(SAMPLES, 1.3 * POINTS),
        {"positions": lambda it: it.positions(MOVED), "__len__": len, "__repr__": repr},
    ),
    "Correspondence": (
        lambda: af.Correspondence(TETRAHEDRON[0], TETRAHEDRON, TETRAHEDRON),
        {
            "values": lambda it: it.values(TETRAHEDRON[0]),
            "displacements": lambda it: it.displacements(TETRAHEDRON[0]),
        },
    ),
    "WrapSequence": (
        lambda: af.WrapSequence(SAMPLES, WRAPPED, COARSE),
        {"next": lambda it: it.next(af.MeshSdf(*TETRAHEDRON))},
    ),
    "ObjectStyle": (
        lambda: af.ObjectStyle(*TETRAHEDRON),
        {"normals": lambda it: it.normals(BALL), "turned": lambda it: it.turned(np.eye(3)).centroid},
    ),
    "PointHandle": (lambda: pins()[0], {}),
    "DeformOptions": (af.DeformOptions, {"to_dict": lambda it: it.to_dict(), "set": assign("width", 32)}),
    "PreparedSplats": (
        lambda: af.PreparedSplats(SPLATS),
        {"moved": lambda it: it.moved(MOVED).rotations, "changes": splat_changes, "__len__": len},
    ),
    "CurveField": (
        lambda: af.deform_curve(BALL[:40, :2], [af.CurveHandle([0])], af.CurveOptions(iterations=2)),
        {"__call__": lambda it: it(POINTS[:, :2]), "jacobian": lambda it: it.jacobian(POINTS[:, :2])},
    ),
}
STATIC = {"load", "from_layers", "preset", "save", "fields", "is_file"}  # and files, which other tests cover


def calls_of(name):
    """The calls of a class, including reads of its properties."""
    make, calls = CLASSES[name]
    kind = getattr(_native, name)
    readers = {
        member: lambda it, member=member: getattr(it, member)
        for member in dir(kind)
        if not member.startswith("_") and isinstance(getattr(kind, member), property)
    }
    return make, {**(readers if len(readers) < 20 else {}), **calls}


def told(answer):
    """A comparable form of a result: bits of arrays and fields, numbers of reports except times."""
    if isinstance(answer, np.ndarray):
        return answer.shape, answer.tobytes()
    if isinstance(answer, af.DeformationField):
        return told(answer(POINTS))
    if isinstance(answer, af.MotionState):
        return tuple(told(getattr(answer, part)) for part in ("coefficients", "velocities", "accelerations"))
    if isinstance(answer, _native.CurveReport):
        return told([getattr(answer, name) for name in dir(answer) if not name.startswith("_")])
    if isinstance(answer, af.reports.Report):
        return tuple((key, told(answer[key])) for key in answer if "seconds" not in key)
    if isinstance(answer, tuple | list):
        return tuple(told(part) for part in answer)
    return repr(answer) if not isinstance(answer, af.Frame) else told(answer.to_mesh(POINTS))


def asked(call, it):
    try:
        return told(call(it))
    except DOCUMENTED as error:
        return type(error).__name__


def in_order(make, calls, order):
    """The results of calls executed in `order`, listed in the order of `calls`."""
    it = make()
    answers = {place: asked(calls[place], it) for place in order}
    return tuple(answers[place] for place in range(len(calls)))


def at_once(make, calls):
    """The same with each call on a separate thread."""
    it, answers = make(), [None] * len(calls)
    begin = threading.Barrier(len(calls))

    def run(place):
        begin.wait()
        answers[place] = asked(calls[place], it)

    threads = [threading.Thread(target=run, args=(place,)) for place in range(len(calls))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive(), "a deadlock"
    return tuple(answers)


def possible(make, calls):
    """The results of all orders."""
    return {in_order(make, calls, order) for order in itertools.permutations(range(len(calls)))}


SPLAT_PARTS = ("centers", "rotations", "scales", "opacities", "harmonics")
LONG = 60.0  # seconds a class
OPTIONS = {name for name in dir(_native) if name.endswith("Options")} - {"DeformOptions"}
# What only holds numbers, or is another class's base or kind.
VALUES = {
    "Bone",
    "Contact",
    "Corrective",
    "Obstacle",
    "GaussianSplats",
    "Handle",
    "CuboidHandle",
    "RegionHandle",
    "CurveHandle",
    "CurveReport",
    "CurveSamples",
    "Distortion",
}


def test_each_class_and_method_is_here():
    classes = {
        name
        for name, kind in vars(_native).items()
        if isinstance(kind, type) and not issubclass(kind, Exception) and not name.startswith("_")
    }
    assert classes - OPTIONS - VALUES - {"OutputFile"} == set(CLASSES)  # OutputFile: below
    for name in CLASSES:
        kind, calls = getattr(_native, name), calls_of(name)[1]
        methods = {m for m in dir(kind) if not m.startswith("_") and callable(getattr(kind, m))}
        assert methods - STATIC - set(calls) == set(), name


@pytest.mark.parametrize("name", CLASSES)
def test_two_methods_at_once(name):
    make, calls = calls_of(name)
    for pair in itertools.combinations_with_replacement(calls, 2):
        both = [calls[one] for one in pair]
        if changes_under_way(name, pair):
            at_once(make, both)
            continue
        assert at_once(make, both) in possible(make, both), pair


@pytest.mark.parametrize("method", ["commit", "finish", "discard"])
def test_an_output_is_finished_once(method, tmp_path):
    """By two threads: it is there, whole, or has been given up; and nothing is left beside it."""
    for number in range(20):
        place = tmp_path / f"{number}.txt"

        def make(place=place):
            place.unlink(missing_ok=True)
            output = _native.OutputFile(place)
            Path(output.partial).write_text("whole")
            return output

        def ended(output):
            getattr(output, method)()

        def committed(output):
            output.commit()

        assert at_once(make, [committed, ended]) in possible(make, [committed, ended])
    assert all(path.read_text() == "whole" for path in tmp_path.glob("*.txt"))
    assert not list(tmp_path.glob(".*"))


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers here")
def test_a_signal_handler_cannot_reenter_the_solver():
    """It runs on the thread that holds the solver, and would wait for itself for ever."""
    ball = np.random.default_rng(0).normal(size=(3000, 3))
    samples = af.SurfaceSamples(ball / np.linalg.norm(ball, axis=1, keepdims=True), ball)
    solver = af.LiveDeformer(samples, pins(), af.LiveOptions(samples=3000, fine_centers=900, interior=False))
    told = []

    def ask(*_):
        try:
            solver.report  # noqa: B018
        except RuntimeError as error:
            told.append(str(error))

    before = signal.signal(signal.SIGALRM, ask)
    signal.setitimer(signal.ITIMER_REAL, 0.02, 0.02)
    try:
        end = time.monotonic() + 60
        while not told and time.monotonic() < end:
            solver.set_symmetry("x")
            solver.set_symmetry("none")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert told and "at work on this thread" in told[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", CLASSES)
def test_two_and_three_methods_for_a_minute(name):
    make, calls = calls_of(name)
    draw, known, end = random.Random(name), {}, time.monotonic() + LONG
    while time.monotonic() < end:
        some = tuple(sorted(draw.choices(list(calls), k=draw.choice((2, 3)))))
        several = [calls[one] for one in some]
        if changes_under_way(name, some):
            at_once(make, several)
            continue
        if some not in known:
            known[some] = possible(make, several)
        assert at_once(make, several) in known[some], some


def test_nobody_takes_the_memory_of_splats_that_are_written(tmp_path):
    many = af.GaussianSplats(*(np.repeat(getattr(SPLATS, name), 2000, axis=0) for name in SPLAT_PARTS))
    prepared, path = af.PreparedSplats(SPLATS), tmp_path / "kept.ply"
    saving = threading.Thread(target=many.save, args=(path,))
    saving.start()
    with contextlib.suppress(af.InvalidInput):  # "another call is at work on it"
        prepared.moved(MOVED, into=many)
    saving.join()
    assert len(af.GaussianSplats.load(path)) in (40000, 0)
