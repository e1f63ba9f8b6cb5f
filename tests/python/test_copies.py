# SPDX-License-Identifier: GPL-3.0-or-later
"""What describes a call can be copied, and sent to another process."""

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from support.geometry.meshes import sphere

import arapfields as af

OPTIONS = sorted(name for name in vars(af) if name.endswith("Options"))
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


def moved_points(field, points):
    return field(points)


def test_a_pool_of_processes_takes_a_field():
    field, points = solved("radial"), np.array([[0.1, 0.2, 0.9]])
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        assert np.array_equal(pool.submit(moved_points, field, points).result(), field(points))


def test_a_frame_is_equal_to_frames_alone():
    frame = af.Frame([0, 0, 0], 1.0)
    assert frame == af.Frame([0, 0, 0], 1.0) != af.Frame([0, 0, 0], 2.0)
    assert frame != 1 and frame not in [None, "frame"]
