# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes to wrap onto each other, and errors of the results."""

import numpy as np
from support.geometry.meshes import sphere
from support.geometry.nudge import nudges

import arapfields as af

SMALL = {"centers": 60, "stages": 3, "iterations": 10}


def figure(subdivisions=4):
    """(n, 3), (m, 3): a closed shape with a long nose and a hump, without rotational symmetry."""
    v, f = sphere(1.0, subdivisions)
    nose = 0.9 * np.exp(-8 * ((v - [1, 0, 0]) ** 2).sum(1, keepdims=True))
    hump = 0.5 * np.exp(-6 * ((v - [0, 0.6, 0.8]) ** 2).sum(1, keepdims=True))
    return v * (1 + nose + hump) * [1.0, 0.7, 0.6], f


def star():
    """(n, 3), (m, 3), (8,): a ball with five different arms; vertices at their ends and beside three."""
    v, f = sphere(1.0, 4)
    arms = np.array([[1, 0, 0], [-0.8, 0.6, 0.1], [0.1, -0.9, 0.4], [-0.3, 0.2, -0.9], [0.2, 0.8, 0.6]])
    arms /= np.linalg.norm(arms, axis=1)[:, None]
    squares = ((v[:, None] - arms) ** 2).sum(2)
    v = v * (0.7 + np.exp(-squares * [14, 18, 12, 16, 14]) @ [[1.8], [1.2], [1.5], [1.0], [1.3]])
    beside = [1.1 * arm + 0.25 * np.cross(arm, [0, 0, 1]) for arm in arms[[0, 1, 4]]]
    ends = [np.argmax(v @ arm) for arm in arms]
    return v, f, np.array(ends + [np.linalg.norm(v - place, axis=1).argmin() for place in beside])


@nudges
def tailed(curl, rings=80, around=16):
    """(n, 3), (m, 3), (8,): a body with two humps and a thin tail bent by `curl`; vertices at its nose, the
    tail's tip and six points between."""
    along = np.linspace(0, 1, rings)
    turn = curl * np.clip((along - 0.62) / 0.38, 0, 1)
    ahead = np.stack([np.cos(turn), np.zeros(rings), np.sin(turn)], 1)
    middle = np.cumsum(ahead, 0) * 1.6 / rings
    aside = np.stack([-ahead[:, 2], np.zeros(rings), ahead[:, 0]], 1)
    radius = np.interp(
        along, [0, 0.06, 0.12, 0.3, 0.5, 0.58, 0.95, 1], [0.03, 0.05, 0.12, 0.16, 0.13, 0.05, 0.035, 0.02]
    )
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    for place, size, way in ((0.25, 0.5, 0.0), (0.45, 0.4, 2.0)):
        hump = np.exp(-(((along[:, None] - place) / 0.06) ** 2) - ((angle - way) / 0.6) ** 2)
        radius = radius.reshape(rings, -1) * (1 + size * hump)
    ring = np.cos(angle)[:, None] * aside[:, None] + np.sin(angle)[:, None] * np.array([0, 1, 0])
    v = (middle[:, None] + radius[..., None] * ring).reshape(-1, 3)
    first = np.arange((rings - 1) * around)
    second = first - first % around + (first + 1) % around
    f = [np.stack([first, first + around, second + around], 1), np.stack([first, second + around, second], 1)]
    place, next_place = np.arange(around), np.roll(np.arange(around), -1)
    nose, tip, last = len(v), len(v) + 1, (rings - 1) * around
    f += [np.stack([np.full(around, nose), place, next_place], 1)]
    f += [np.stack([np.full(around, tip), last + next_place, last + place], 1)]
    v = np.concatenate([v, v[:around].mean(0)[None], v[-around:].mean(0)[None]])
    on_body = [round(rings * share) * around + k for share, k in ((0.25, 0), (0.25, 4), (0.25, 12))]
    on_body += [round(rings * share) * around + k for share, k in ((0.45, 5), (0.5, 0), (0.52, 8))]
    return v, np.concatenate(f).astype(np.int32), np.array([nose, tip, *on_body])


def doll(head, body):
    """A ball with a nose on a ball with feet, of these radii; it faces -y."""
    balls = [(body, (0, 0, 0)), (head, (0, 0, 0.8)), (0.12, (0, -head, 0.8))]
    balls += [(0.15, (side, -0.1, -0.45)) for side in (-0.25, 0.25)]
    v, f = sphere(1.0, 3)
    return np.concatenate([radius * v + at for radius, at in balls]), np.concatenate(
        [f + k * len(v) for k in range(len(balls))]
    )


def rotation(axis, angle):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * cross.T + (1 - np.cos(angle)) * cross @ cross


def bend(points, rate=0.25):
    """A known field that bends space about the z axis, increasingly along x."""
    angle = rate * points[:, 0]
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = points.T
    return np.stack([c * x - s * y, s * x + c * y, z], 1)


def moved(points, scale=3.0, angle=2.0):
    return scale * bend(points) @ rotation([1, 2, 3], angle).T + [5.0, -2.0, 1.0]


def distances(vertices, triangles, onto_vertices, onto_triangles, count=5000):
    """((mean, 95th percentile) to the target, the same from it), exact, in % of the target's diagonal."""
    diagonal = np.linalg.norm(np.ptp(onto_vertices, axis=0))
    pairs = []
    for mesh, other in (
        ((vertices, triangles), (onto_vertices, onto_triangles)),
        ((onto_vertices, onto_triangles), (vertices, triangles)),
    ):
        points = af.sample_mesh(*mesh, count).points
        away = 100 * np.abs(af.MeshSdf(*other)(points)) / diagonal
        pairs.append((away.mean(), np.quantile(away, 0.95)))
    return tuple(pairs)


def crossing_share(vertices, triangles):
    """Share of the triangles that intersect another one without a common vertex."""
    from scipy.spatial import cKDTree

    corners = vertices[triangles]
    low, high = corners.min(1), corners.max(1)
    reach = np.linalg.norm(high - low, axis=1).max() / 2
    pairs = cKDTree((low + high) / 2).query_pairs(2 * reach, output_type="ndarray")
    i, j = pairs.T
    near = ((low[i] <= high[j]) & (low[j] <= high[i])).all(1)
    i, j = i[near], j[near]
    apart = ~(triangles[i][:, :, None] == triangles[j][:, None, :]).any((1, 2))
    i, j = i[apart], j[apart]
    hit = np.zeros(len(i), bool)
    for k in range(3):
        hit |= pierced(corners[i], corners[j][:, k], corners[j][:, (k + 1) % 3])
        hit |= pierced(corners[j], corners[i][:, k], corners[i][:, (k + 1) % 3])
    return len(np.unique(np.concatenate([i[hit], j[hit]]))) / len(triangles)


def pierced(triangles, start, end):
    """Whether the segments from start to end, (n, 3) each, intersect the triangles (n, 3, 3)."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = np.cross(b - a, c - a)
    before, after = ((start - a) * normal).sum(1), ((end - a) * normal).sum(1)
    through = before * after < 0
    share = before / np.where(through, before - after, 1.0)
    place = start + share[:, None] * (end - start)
    for u, w in ((a, b), (b, c), (c, a)):
        through &= (np.cross(w - u, place - u) * normal).sum(1) > 0
    return through
