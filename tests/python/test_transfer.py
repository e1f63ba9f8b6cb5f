# SPDX-License-Identifier: GPL-3.0-or-later
"""What one mesh has, carried over to another that it was wrapped onto, and back."""

import threading
import time

import numpy as np
import pytest
from support.geometry import wrap_cases as cases

import arapfields as af

ROUNDING = 1e-12
# Of a key on a mesh of other triangles, in its largest motion: what linear interpolation leaves.
INTERPOLATION = 0.03
# Of distances from the skin, on average: surfaces of some hundred triangles bend between samples.
KEPT = 0.08
# The same of the worst vertex; what triangles tell of the growth across them is .3 off.
ACROSS = 0.05
# The same where a map bends or swells: what a surface tells of space beside it.
KNOWN_MAP = 0.1
TURN = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def figure():
    return cases.figure(4)


def key_at(points, center, radius=0.5):
    """A bulge that also turns, as an expression does."""
    return np.exp(-(((points - center) / radius) ** 2).sum(axis=1))[:, None] * [0.05, 0.1, -0.04]


@pytest.mark.parametrize("back", [False, True])
def test_a_similarity_carries_exactly(figure, back):
    v, f = figure
    moved = 2.5 * v @ TURN.T + [1, 2, 3]
    target = (moved, f) if not back else (moved[::-1].copy(), len(v) - 1 - f)
    places = af.Correspondence(moved, (v, f), target, back=back)
    assert places.distances.max() < ROUNDING * 100
    assert np.abs(places.shares.sum(axis=1) - 1).max() < ROUNDING and places.shares.min() >= 0
    rng = np.random.default_rng(0)
    given = rng.normal(size=(4, len(v), 3))
    turned = given[:, ::-1] @ TURN / 2.5 if back else 2.5 * given @ TURN.T
    assert np.abs(places.displacements(given) - turned).max() < 1e-9
    colours = rng.random((len(v), 4))
    assert np.abs(places.values(colours) - (colours[::-1] if back else colours)).max() < 1e-9


def test_keys_follow_a_known_map_onto_other_triangles(figure):
    """f itself is the wrap; the target is the moved surface, cut into other triangles."""
    v, f = figure
    fine, faces = cases.figure(5)
    turn = np.eye(4)
    turn[:3, :3], turn[:3, 3] = TURN, [0.3, 0.2, 0.1]
    ends = [af.CuboidHandle(box_at(x), m) for x, m in ((-1.2, box_at(-1.2)), (1.2, turn @ box_at(1.2)))]
    field = af.deform(af.sample_mesh(v, f, 1500), ends, af.DeformOptions(centers=60))
    rows = np.random.default_rng(1).permutation(len(fine))
    target = field(fine[rows]), np.argsort(rows)[faces].astype(np.int32)
    for center in v[[0, len(v) // 3, len(v) // 2]]:
        told = field(fine[rows] + key_at(fine[rows], center)) - target[0]
        found = af.transfer(field, (v, f), target, {"displacements": key_at(v, center), "values": v[:, 0]})
        assert np.abs(found["values"] - fine[rows][:, 0]).max() < 0.05
        assert (
            np.linalg.norm(found["displacements"] - told, axis=1).mean() < INTERPOLATION * np.abs(told).max()
        )
        by_mesh = af.transfer(field(v), (v, f), target, {"displacements": key_at(v, center)})
        away = np.linalg.norm(by_mesh["displacements"] - told, axis=1)
        assert away.mean() < INTERPOLATION * np.abs(told).max()


@pytest.mark.parametrize("axis", range(3))
def test_curves_show_growth_across_the_surface(figure, axis):
    v, f = figure
    fine, faces = cases.figure(5)
    grown = np.where(np.arange(3) == axis, 1.6, 1.0)
    for center in v[[0, len(v) // 3, v[:, axis].argmax()]]:
        given, told = (key_at(points, center) for points in (v, fine))
        found = af.transfer(v * grown, (v, f), (fine * grown, faces), {"displacements": given})
        away = np.linalg.norm(found["displacements"] - told * grown, axis=1)
        assert away.max() < ACROSS * np.linalg.norm(told * grown, axis=1).max()


def swollen(points):
    near = np.exp(-((points - [0.5, 0.3, 0.2]) ** 2).sum(axis=1) / 0.5)
    return points * (1 + 0.25 * near)[:, None]


@pytest.mark.parametrize("known", [cases.bend, swollen])
def test_keys_are_as_if_the_map_had_moved_their_shapes(figure, known):
    """Beyond J, too: these keys move by a twentieth of the size, over which J changes."""
    v, f = figure
    fine, faces = cases.figure(5)
    for center in v[[0, len(v) // 5, len(v) // 3, len(v) // 2]]:
        told = known(fine + key_at(fine, center)) - known(fine)
        found = af.transfer(known(v), (v, f), (known(fine), faces), {"displacements": key_at(v, center)})
        away = np.linalg.norm(found["displacements"] - told, axis=1)
        assert away.max() < KNOWN_MAP * np.linalg.norm(told, axis=1).max()


def folded(v, f, motion):
    """Triangles whose normal turns by more than a right angle."""
    normal, moved = (np.cross(x[f[:, 1]] - x[f[:, 0]], x[f[:, 2]] - x[f[:, 0]]) for x in (v, v + motion))
    return ((normal * moved).sum(axis=1) < 0).sum()


def test_a_far_motion_folds_no_small_triangle(figure):
    """The wrap's surface is uneven, so its Jacobians change from one triangle to the next."""
    v, f = figure
    uneven = np.random.default_rng(0).normal(size=v.shape)
    wrapped = v + 0.01 * uneven
    fine, faces = cases.figure(5)
    key = 8 * key_at(v, v[0], 0.6)
    assert folded(v, f, key) == 0
    found = af.transfer(wrapped, (v, f), (fine, faces), {"displacements": key})["displacements"]
    assert folded(fine, faces, found) == 0
    told = 8 * key_at(fine, v[0], 0.6)
    away = np.linalg.norm(found - told, axis=1)
    assert away.mean() < INTERPOLATION * np.abs(told).max()


def box_at(x):
    box = np.diag([0.4, 2.0, 2.0, 1.0])
    box[0, 3] = x
    return box


def test_both_sides_of_a_thin_sheet_keep_theirs():
    """Its upper side lies nearest to the target's lower one."""
    n = 12
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij")
    sheet = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    at = np.arange(n * n).reshape(n, n)
    corners = [at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]]
    quads = np.stack([c.ravel() for c in corners], axis=1)
    up = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]).astype(np.int32)
    thin = np.concatenate([sheet, sheet + np.array([0, 0, 0.01])])
    faces = np.concatenate([up[:, ::-1], up + n * n]).astype(np.int32)
    side = np.repeat([0.0, 1.0], n * n)
    target = thin - np.array([0, 0, 0.008])
    found = af.transfer(thin, (thin, faces), (target, faces), {"values": side})["values"]
    assert np.array_equal(found, side)


def test_bad_input_is_named(figure):
    v, f = figure
    places = af.Correspondence(v, (v, f), (v, f))
    with pytest.raises(af.InvalidInput, match="field: 3 moved vertices"):
        af.Correspondence(v[:3], (v, f), (v, f))
    with pytest.raises(af.InvalidInput, match="what: unknown key keys"):
        af.transfer(v, (v, f), (v, f), {"keys": v})
    with pytest.raises(af.InvalidInput, match="displacements: 5 vertices"):
        places.displacements(np.zeros((5, 3)))
    with pytest.raises(af.InvalidInput, match="displacements: got shape"):
        places.displacements(np.zeros(len(v)))
    with pytest.raises(af.InvalidInput, match="target"):
        af.Correspondence(v, (v, f), v[0])
    with pytest.raises(af.InvalidInput, match="triangles"):
        af.Correspondence(v, (v, f), (v, f + 1))
    with pytest.raises(af.Cancelled):
        task = af.Task()
        task.cancel()
        af.Correspondence(v, (v, f), (v, f), task=task)


@pytest.mark.parametrize("distance", [0.01, 0.03, 0.1, 0.2])
def test_clothes_keep_their_distance_as_the_body_grows(distance):
    """Near the surface, where frames carry, and between: in units of how a wrap grows the surface there."""
    v, f = cases.figure(3)
    fat = v * (1 + 0.6 * np.exp(-3 * ((v - [-0.9, 0, 0]) ** 2).sum(1, keepdims=True)))
    samples, options = af.sample_mesh(v, f, 3000), af.WrapOptions(alignment="none", **cases.SMALL)
    field = af.wrap(samples, af.MeshSdf(fat, f), [], options)
    body = field(v)
    normals, areas = zip(*(vertex_normals(shape, f) for shape in (v, body)), strict=True)
    worn = v + distance * normals[0]
    now = af.MeshSdf(body, f)(af.Attachment(samples, worn).positions(field))
    before = af.MeshSdf(v, f)(worn)
    clear = before > 0.8 * distance  # of other parts of the body
    ratio = (now / before / np.sqrt(areas[1] / areas[0]))[clear]
    assert np.abs(ratio - 1).mean() < KEPT and now.min() > 0


def vertex_normals(vertices, triangles):
    """(n, 3) unit normals, and (n,) areas about the vertices."""
    corners = vertices[triangles]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = [
        np.bincount(triangles.ravel(), np.repeat(c, 3), minlength=len(vertices))
        for c in (*crosses.T, np.linalg.norm(crosses, axis=1))
    ]
    normals = np.stack(sums[:3], axis=1)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True), sums[3]


def test_a_cancel_does_not_wait_for_the_keys(figure):
    """Neither for those to come, nor for what the first of them prepares."""
    v, f = figure
    moved = 2.0 * v @ TURN.T
    for places in (af.Correspondence(moved, (v, f), (moved, f)), None):
        task = af.Task()
        task.cancel()
        with pytest.raises(af.Cancelled):
            if places:
                places.displacements(np.zeros((3, len(v), 3)), task=task)
            else:
                af.transfer(moved, (v, f), (moved, f), {"displacements": v}, task=task)
    places = af.Correspondence(moved, (v, f), (moved, f))
    whole, task = af.Task(), af.Task()
    keys = np.stack([v] * 20)
    carried = places.displacements(keys, task=whole)  # prepares what the next call has at hand
    assert whole.progress == 1.0
    results = []

    def carry():
        with pytest.raises(af.Cancelled):
            results.append(places.displacements(keys, task=task))

    thread = threading.Thread(target=carry)
    thread.start()
    while not task.progress:
        time.sleep(1e-4)
    task.cancel()
    thread.join()
    assert task.progress < 0.5 and not results
    assert np.array_equal(places.displacements(keys[:1])[0], carried[0])  # nothing is left half-done
