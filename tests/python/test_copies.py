# SPDX-License-Identifier: GPL-3.0-or-later
"""What describes a call can be copied, and sent to another process."""

import copy
import copyreg
import inspect
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from support.geometry.meshes import sphere

import arapfields as af

OPTIONS = sorted(name for name in vars(af) if name.endswith("Options"))
# What belongs to its process: refused in one sentence, which says what to send.
BOUND = (
    "Attachment",
    "Correspondence",
    "LiveDeformer",
    "MotionState",
    "PointCacheReader",
    "PointCacheWriter",
)
BOUND += ("Task", "WrapSequence")
NO_VALUES = ("ArrayLike", "DeformationField", "Energy", "Handle")  # protocols, bases and names of types
TURN = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
UP = np.eye(4) + 0.2 * np.eye(4, k=3)
WIDE = np.diag([2.0, 2, 4, 1])
DESCRIBED = {
    "box": lambda: af.CuboidHandle(np.diag([1.0, 2, 3, 1]), WIDE, 0.3, allow_scale=True, reach=0.7),
    "point": lambda: af.PointHandle([0, 1, 2], [3, 4, 5], 0.3, reach=0.7),
    "region": lambda: af.RegionHandle([3, 1], np.eye(4), UP, 0.3, reach=0.7),
    "curve": lambda: af.CurveHandle([3, 1], np.eye(3), 0.3),
    "frame": lambda: af.Frame([1, 2, 3], 0.4),
}
WAYS = {"copy": copy.copy, "deepcopy": copy.deepcopy, "pickle": lambda one: pickle.loads(pickle.dumps(one))}


def attributes(one):
    names = [name for name in dir(one) if not name.startswith("_") and not callable(getattr(one, name))]
    return {name: np.asarray(getattr(one, name)).tolist() for name in names}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", OPTIONS)
def test_options(name, way):
    options = getattr(af, name)()
    changed = next(
        (field for field in options.fields if field in ("seed", "samples", "bending", "margin")), None
    )
    if changed:
        setattr(options, changed, getattr(options, changed) + 1)
    again = WAYS[way](options)
    assert again == options and again is not options
    if changed:
        setattr(again, changed, getattr(again, changed) + 1)
        assert again != options


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", DESCRIBED)
def test_handles_and_frames(kind, way):
    one = DESCRIBED[kind]()
    again = WAYS[way](one)
    assert type(again) is type(one) and attributes(again) == attributes(one)


def solved(field):
    mesh = sphere(1.0, 2)
    handles = [af.PointHandle([0, 0, -1], [0, 0, -1]), af.PointHandle([0, 0, 1], [0, 0.1, 1.2])]
    options = af.DeformOptions(field=field, iterations=5)
    return af.deform(af.sample_mesh(*mesh, count=100, seed=0), handles, options)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", ["radial", "neural", "invertible", "network"])
def test_fields_and_networks(kind, way):
    points = np.array([[0.1, 0.2, 0.9], [0, -0.7, 0.7]])
    if kind == "network":
        one = af.fit_sdf(*sphere(1.0, 2), af.FitOptions(iterations=3, width=16))
    else:
        one = solved(kind)
    again = WAYS[way](one)
    assert type(again) is type(one) and np.array_equal(again(points), one(points))
    assert attributes(again.report) == attributes(one.report)


def energy(handles, options):
    mesh = sphere(1.0, 2)
    return af.deform(af.sample_mesh(*mesh, count=100, seed=0), handles, options).report.energy


def test_a_pool_of_processes_takes_them():
    handles = [af.PointHandle([0, 0, -1], [0, 0, -1]), af.PointHandle([0, 0, 1], [0, 0.1, 1.2])]
    options = af.DeformOptions(field="radial", iterations=5)
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        assert pool.submit(energy, handles, options).result() == energy(handles, options)


class Ball(af.ImplicitFunction):
    def __init__(self, radius):
        super().__init__(af.Frame([0, 0, 0], 2.0))
        self.radius = radius

    def __call__(self, points):
        return np.linalg.norm(points, axis=1) - self.radius


def splats(count=20):
    random = np.random.default_rng(0)
    turns = random.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1)[:, None]
    widths, seen = random.uniform(0.01, 0.1, (count, 3)), random.uniform(0.1, 0.9, count)
    return af.GaussianSplats(
        random.normal(size=(count, 3)), turns, widths, seen, random.normal(size=(count, 4, 3))
    )


def curve_field():
    samples = af.sample_curve(np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]), 40)
    handles = [af.CurveHandle([0]), af.CurveHandle([20], np.array([[1, 0, 0.1], [0, 1, 0], [0, 0, 1.0]]))]
    return af.deform_curve(samples.points, handles)


def corrective():
    mesh = sphere(1.0, 2)
    bones = [af.Bone([0, 0, -0.8], [0, 0, 0]), af.Bone([0, 0, 0], [0, 0, 0.8], 0)]
    options = af.SkinOptions(samples=300, poses=4, correctives=1)
    weights = af.skin_weights(mesh, bones, options)
    return af.skin_correctives(*mesh, bones, weights, options)[0]


def bound_of(function):
    return af.Obstacle(function, 0.1, placement=np.diag([2.0, 2, 2, 1]))


def iteration():
    seen = []
    options = af.DeformOptions(field="neural", iterations=1, width=4, layers=1)
    af.deform(
        af.sample_mesh(*sphere(1.0, 2), count=100),
        [af.PointHandle([0, 0, 1], [0, 0, 1])],
        options,
        callback=seen.append,
    )
    return seen[0]


VALUES = {
    "Bone": lambda: af.Bone([0, 0, 0], [0, 0, 1], 2, 0.3, deform=False, limits=[[-1, 1]] * 3, name="Arm"),
    "Contact": lambda: af.Contact([bound_of(Ball(0.5))], ground=0.1, up=[0, 1, 0], itself=True, friction=0.2),
    "Corrective": corrective,
    "CurveField": curve_field,
    "CurveReport": lambda: curve_field().report,
    "CurveSamples": lambda: af.sample_curve(np.array([[0, 0], [1, 0], [1, 1.0]]), 10),
    "EnergyValue": lambda: af.EnergyValue(0.5, np.ones((2, 3))),
    "Extraction": lambda: af.extract_surface(Ball(0.5), 16),
    "Jets": lambda: af.Jets(np.ones((1, 3)), np.zeros((1, 3)), np.ones((1, 3, 3))),
    "Distortion": lambda: af.distortion(solved("radial"), sphere(1.0, 2)[0]),
    "Diverged": lambda: af.Diverged("NaN at iteration 3"),
    "GaussianSplats": splats,
    "ImplicitFunction": lambda: af.ImplicitFunction(af.Frame([1, 2, 3], 0.4)),
    "InvalidInput": lambda: af.InvalidInput("count: 0; at least 1 is needed"),
    "Iteration": iteration,
    "MeshSdf": lambda: af.MeshSdf(*sphere(1.0, 2)),
    "ObjectStyle": lambda: af.ObjectStyle(*sphere(1.0, 2)).turned(TURN),
    "Obstacle": lambda: bound_of(af.MeshSdf(*sphere(1.0, 2))),
    "PreparedSplats": lambda: af.PreparedSplats(splats()),
    "Python's function": lambda: Ball(0.7),
    "SurfaceSamples": lambda: af.sample_surface(Ball(0.7), 50),
    "SurfaceSamples of meshes": lambda: af.sample_meshes(
        [sphere(1.0, 2), sphere(0.3, 1)], 60, weights=[None, np.ones(len(sphere(0.3, 1)[0])) * 3]
    ),
}


def plain(value):
    """A value that equals another's where what both hold is the same."""
    if type(value).__module__.startswith("arapfields") or isinstance(value, Ball):
        names = [name for name in dir(value) if not name.startswith("_")]
        held = {name: getattr(value, name) for name in names if name not in ("report", "hessians")}
        return {name: plain(one) for name, one in held.items() if not inspect.isroutine(one)}
    if isinstance(value, tuple | list):
        return [plain(one) for one in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    return dict(value) if hasattr(value, "keys") else value


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", VALUES)
def test_copies_have_equal_values(kind, way):
    one = VALUES[kind]()
    again = WAYS[way](one)
    assert type(again) is type(one) and again is not one and plain(again) == plain(one)
    if callable(one) and type(one) is not af.ImplicitFunction:
        points = np.array([[0.1, 0.2, 0.9], [0, -0.7, 0.7]])[:, : 2 if kind == "CurveField" else 3]
        assert np.array_equal(again(points), one(points))
    if kind == "ObjectStyle":
        assert np.array_equal(again.normals(TURN), one.normals(TURN))
    if kind == "Corrective":
        assert again.value(TURN) == one.value(TURN)
    if kind in ("SurfaceSamples", "Extraction"):
        assert again.report == one.report


def test_every_public_class_pickles_or_names_a_substitute():
    covered = {type(VALUES[name]()) for name in VALUES} | {type(DESCRIBED[name]()) for name in DESCRIBED}
    others = (*OPTIONS, *BOUND, *NO_VALUES, "RadialField", "NeuralSdf", "Cancelled")
    covered |= {getattr(af, name) for name in others}
    public = {one for one in (getattr(af, name) for name in af.__all__) if inspect.isclass(one)}
    assert not {one for one in public - covered if not issubclass(one, af.Report)}


@pytest.mark.parametrize("name", BOUND)
def test_unpicklable_objects_name_a_substitute(name, tmp_path):
    mesh, handles = sphere(1.0, 2), [af.PointHandle([0, 0, 1], [0, 0, 1])]
    samples = af.sample_mesh(*mesh, count=100)
    with af.PointCacheWriter(tmp_path / "one.pc2", 2, 1) as writer:
        writer.write(np.zeros((2, 3)))
    wrapped = af.wrap(samples, af.MeshSdf(*mesh)) if name == "WrapSequence" else None
    one = {
        "Attachment": lambda: af.Attachment(samples, mesh[0]),
        "Correspondence": lambda: af.Correspondence(mesh[0], mesh, mesh),
        "LiveDeformer": lambda: af.LiveDeformer(samples, handles),
        "MotionState": lambda: af.LiveDeformer(samples, handles).motion_state,
        "PointCacheReader": lambda: af.PointCacheReader(tmp_path / "one.pc2"),
        "PointCacheWriter": lambda: af.PointCacheWriter(tmp_path / "two.pc2", 2, 1),
        "Task": af.Task,
        "WrapSequence": lambda: af.WrapSequence(samples, wrapped),
    }[name]()
    for way in WAYS.values():
        with pytest.raises(TypeError, match=f"{name}: it belongs to its process.*; send "):
            way(one)


def test_copied_samples_redraw_and_unpickled_ones_refuse():
    samples = af.sample_mesh(*sphere(1.0, 2), count=100)
    options = af.DeformOptions(field="neural", iterations=1, width=4, layers=1, fresh_samples=5)
    handles = [af.PointHandle([0, 0, 1], [0, 0, 1])]
    for way in (copy.copy, copy.deepcopy):
        af.deform(way(samples), handles, options)
    with pytest.raises(af.InvalidInput, match="fresh_samples"):
        af.deform(pickle.loads(pickle.dumps(samples)), handles, options)


STATED = (
    "SurfaceSamples",
    "ObjectStyle",
    "Distortion",
    "Corrective",
    "CurveField",
    "CurveReport",
    "CurveSamples",
)
ODD = (None, "x", b"x", [], np.array([[np.nan] * 3]), np.full((1, 2), 1e300), -1, 1e9, object(), {}, (1, 2))


@pytest.mark.parametrize("kind", STATED)
def test_a_damaged_pickle_is_refused_or_complete(kind):
    state = VALUES[kind]().__reduce_ex__(2)[2]
    for number in range(len(state)):
        for odd in ODD:
            parts = (*state[:number], odd, *state[number + 1 :])
            one = getattr(af, kind).__new__(getattr(af, kind))
            try:
                one.__setstate__(parts)
            except (af.InvalidInput, TypeError) as error:
                assert str(error)
            else:
                assert plain(one) is not None
    for parts in ((), state[1:], (*state, 1), None, 3):
        with pytest.raises((af.InvalidInput, TypeError)):
            getattr(af, kind).__new__(getattr(af, kind)).__setstate__(parts)


@pytest.mark.parametrize("kind", ["field", "network", "splats"])
def test_a_damaged_file_in_a_pickle_names_the_class(kind):
    one = {
        "field": lambda: solved("radial"),
        "network": lambda: af.fit_sdf(*sphere(1.0, 2), af.FitOptions(iterations=1, width=8, near_points=500)),
        "splats": splats,
    }[kind]()
    make, (made, content) = copyreg.dispatch_table[type(one)](one)
    for damaged in (content[:-3], b"", b"x" * 40, None, "text"):
        with pytest.raises(af.InvalidInput, match=f"pickled {type(one).__name__}"):
            make(made, damaged)


def moved_points(field, points):
    return field(points)


def test_a_pool_of_processes_takes_a_field():
    field, points = solved("radial"), np.array([[0.1, 0.2, 0.9]])
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        assert np.array_equal(pool.submit(moved_points, field, points).result(), field(points))


def test_a_frame_equals_only_frames():
    frame = af.Frame([0, 0, 0], 1.0)
    assert frame == af.Frame([0, 0, 0], 1.0) != af.Frame([0, 0, 0], 2.0)
    assert frame != 1 and frame not in [None, "frame"]
