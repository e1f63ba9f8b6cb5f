# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of tests, with handles that bend them: vertices (n, 3) float64, triangles (m, 3) int64."""

import functools
import os
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np
from support.geometry import cases
from support.geometry.nudge import nudged, nudges

import arapfields as af

# Meshes of tests: vertices (n, 3) float64, triangles (m, 3) int64, counter-clockwise from outside.
#
# And small networks without PyTorch, for short processes.


def grid_triangles(rows, columns, wrap_rows=False, wrap_columns=False):
    """Two triangles per cell of a rows × columns grid of vertices; wrapping joins opposite borders."""
    i, j = np.meshgrid(
        np.arange(rows if wrap_rows else rows - 1), np.arange(columns if wrap_columns else columns - 1)
    )
    i, j = i.ravel(), j.ravel()
    k, l = (i + 1) % rows, (j + 1) % columns
    a, b, c, d = i * columns + j, k * columns + j, k * columns + l, i * columns + l
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


@nudges
def torus(major=1.0, minor=0.4, around=48, tube=24):
    u = np.linspace(0, 2 * np.pi, around, endpoint=False)[:, None]
    v = np.linspace(0, 2 * np.pi, tube, endpoint=False)[None, :]
    ring = major + minor * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), minor * np.sin(v) + 0 * u], -1)
    return points.reshape(-1, 3), grid_triangles(around, tube, True, True)


@nudges
def sphere(radius=1.0, subdivisions=3):
    """A subdivided octahedron with its vertices projected to the sphere."""
    vertices = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    upper = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4]]
    triangles = np.array(upper + [[b, a, 5] for a, b, _ in upper])
    for _ in range(subdivisions):
        vertices, triangles = subdivide(vertices, triangles)
    return radius * vertices / np.linalg.norm(vertices, axis=1, keepdims=True), triangles


def subdivide(vertices, triangles):
    """Splits each triangle into four at the midpoints of its edges, without changing the surface."""
    edges = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1
    )
    edges, which = np.unique(edges, axis=0, return_inverse=True)
    ab, bc, ca = which.reshape(3, -1) + len(vertices)
    a, b, c = triangles.T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    middles = vertices[edges].mean(axis=1)
    return np.concatenate([vertices, middles]), np.concatenate([np.stack(p, 1) for p in parts])


@nudges
def box(half=(1.0, 1.0, 1.0)):
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.asarray(
        half, float
    )
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return corners, np.array([t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])])


def check_closed(V, F):
    """Asserts a closed manifold, counter-clockwise from outside."""
    edges = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]).astype(np.int64)
    forwards, backwards = edges @ [len(V), 1], edges @ [1, len(V)]
    assert len(np.unique(forwards)) == len(forwards)  # no directed edge occurs twice
    assert np.array_equal(np.sort(forwards), np.sort(backwards))  # each edge occurs once in each direction
    assert np.einsum("ij,ij->i", V[F[:, 0]], np.cross(V[F[:, 1]], V[F[:, 2]])).sum() > 0


def read(path):
    """Vertices and triangles of an OBJ or OFF file; polygons lose one ear after the other."""
    path = Path(path)
    lines = [line.split() for line in path.read_text().splitlines() if line.strip() and line[0] != "#"]
    if path.suffix == ".off":
        count, faces = int(lines[1][0]), int(lines[1][1])
        vertices = [row[:3] for row in lines[2 : 2 + count]]
        polygons = [
            [int(i) for i in row[1 : 1 + int(row[0])]] for row in lines[2 + count : 2 + count + faces]
        ]
    else:
        vertices = [row[1:4] for row in lines if row[0] == "v"]
        polygons, given = [], 0
        for row in lines:
            given += row[0] == "v"
            if row[0] == "f":
                indices = [int(word.split("/")[0]) for word in row[1:]]
                polygons.append([i - 1 if i > 0 else given + i for i in indices])
    vertices = np.array(vertices, float)
    triangles = [[p[i] for i in ear] for p in polygons for ear in ears(vertices[p])]
    return vertices, np.array(triangles)


def ears(outline):
    """Triangles of a polygon (k, 3) in space, as indices of its corners: its ears, one after the other."""
    ring = list(range(len(outline)))
    if len(ring) == 3:
        return [ring]
    shape = outline - outline[0]
    normal = np.cross(shape, np.roll(shape, -1, axis=0)).sum(axis=0)
    found = []
    while len(ring) > 3:
        turns = [(ring[k - 1], ring[k], ring[(k + 1) % len(ring)]) for k in range(len(ring))]
        ear = next((turn for turn in turns if is_ear(shape, turn, ring, normal)), turns[0])
        found.append(ear)
        ring.remove(ear[1])
    return [*found, tuple(ring)]


def is_ear(points, turn, ring, normal):
    """Whether a corner of a polygon turns inwards, with none of the other corners in its triangle."""
    corners = points[list(turn)]
    sides = np.roll(corners, -1, axis=0) - corners
    if np.cross(sides[0], sides[1]) @ normal <= 0:
        return False
    others = points[[i for i in ring if i not in turn]]
    within = np.cross(sides[None], others[:, None] - corners[None]) @ normal >= 0
    return not within.all(axis=1).any()


@functools.cache
@nudges
def suzanne():
    """Blender's monkey: open at the eyes, with parts that intersect. Needs bpy, or a file with the mesh,
    ARAPFIELDS_SUZANNE, on processors for which there is no bpy."""
    if "ARAPFIELDS_SUZANNE" in os.environ:
        return read_arrays(os.environ["ARAPFIELDS_SUZANNE"])
    code = (
        "import sys, bpy, numpy as np\n"
        "bpy.ops.mesh.primitive_monkey_add()\n"
        "mesh = bpy.context.object.data\n"
        "mesh.calc_loop_triangles()\n"
        "np.savez(sys.argv[1], v=[tuple(v.co) for v in mesh.vertices],\n"
        "         f=[tuple(t.vertices) for t in mesh.loop_triangles])\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "suzanne.npz"
        subprocess.run([sys.executable, "-c", code, str(file)], check=True, capture_output=True)
        return read_arrays(file)


def read_arrays(file):
    arrays = np.load(file)
    return arrays["v"].astype(float), arrays["f"].astype(np.int64)


def small_layers(seed=0, width=8, layers=2, octaves=4):
    """(weights, biases) of a small network with random entries."""
    rng = np.random.default_rng(seed)
    sizes = [6 * octaves, *[width] * layers, 1]
    weights = [rng.normal(size=(b, a)) / a**0.5 for a, b in pairwise(sizes)]
    return weights, [rng.normal(size=b) * 0.1 for b in sizes[1:]]


# A bar of size 4 × 1 × 1 along x with a handle at each end.


def bar_samples(count=6000, seed=0):
    """Uniform samples of the bar's surface, with normals."""
    rng = np.random.default_rng(seed)
    half = np.array([2.0, 0.5, 0.5])
    areas = np.array([half[1] * half[2], half[0] * half[2], half[0] * half[1]])
    axis = rng.choice(3, size=count, p=areas / areas.sum())
    side = rng.choice([-1.0, 1.0], size=count)
    points = rng.uniform(-1, 1, size=(count, 3)) * half
    normals = np.zeros((count, 3))
    normals[np.arange(count), axis] = side
    points[np.arange(count), axis] = side * half[axis]
    return af.SurfaceSamples(nudged(points), normals)


def handle_box(center, half):
    matrix = np.diag([*map(float, half), 1.0])
    matrix[:3, 3] = center
    return matrix


def turned(degrees, axis=1, shift=(0, 0, 0)):
    angle = np.radians(degrees)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.eye(4)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[i, j], matrix[j, i] = -np.sin(angle), np.sin(angle)
    matrix[:3, 3] = shift
    return matrix


LEFT, RIGHT = handle_box([-1.8, 0, 0], [0.3, 0.6, 0.6]), handle_box([1.8, 0, 0], [0.3, 0.6, 0.6])


# A fork: a tube along a U, whose legs are close in space but far apart along the surface.

RADIUS, BEND, LEG = 0.15, 0.22, 1.0
LEGS = {side: np.array([[side * BEND, 0, LEG + RADIUS]]) for side in (-1, 1)}
BOTTOM = handle_box([0, 0, -BEND], [0.6, 0.3, 0.3])
TIP = handle_box([BEND, 0, LEG], [0.2, 0.2, 0.2])


def fork_samples(count=8000, seed=0):
    """Samples with normals of legs of length LEG along z at x = ±BEND, a half circle below and round ends."""
    rng = np.random.default_rng(seed)
    arc, cap = np.pi * BEND, 2 * np.pi * RADIUS**2
    tube = 2 * np.pi * RADIUS * (2 * LEG + arc)
    on_cap = rng.random(count) < 2 * cap / (2 * cap + tube)
    along = rng.uniform(0, 2 * LEG + arc, count)
    angle = (np.clip(along, LEG, LEG + arc) - LEG) / BEND
    outward = np.c_[-np.cos(angle), np.zeros(count), -np.sin(angle)]  # from the middle of the bend
    center = BEND * outward
    center[:, 2] += np.where(along < LEG, LEG - along, np.maximum(along - LEG - arc, 0.0))
    turn = rng.uniform(0, 2 * np.pi, count)
    normals = np.cos(turn)[:, None] * outward + np.sin(turn)[:, None] * [0.0, 1.0, 0.0]
    round_ = rng.normal(size=(count, 3))
    round_[:, 2] = np.abs(round_[:, 2])
    round_ /= np.linalg.norm(round_, axis=1)[:, None]
    ends = np.c_[rng.choice([-BEND, BEND], count), np.zeros(count), np.full(count, LEG)]
    center[on_cap], normals[on_cap] = ends[on_cap], round_[on_cap]
    return af.SurfaceSamples(nudged(center + RADIUS * normals), normals)


# Thin plates and open sheets of tests, and handles that bend and twist them.

FAR = 9.0  # of a box's sides that bound nothing


def open_sheet(length, width, around=40, across=40):
    """A flat rectangle about the origin, normals along z."""
    x, y = np.meshgrid(
        np.linspace(-length / 2, length / 2, around + 1),
        np.linspace(-width / 2, width / 2, across + 1),
        indexing="ij",
    )
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1), grid_triangles(around + 1, across + 1)


def plate(length, width, thickness, around=40, across=40):
    """The same with a bottom and sides: closed."""
    v, f = open_sheet(length, width, around, across)
    n = len(v)
    rows = np.arange(n).reshape(around + 1, across + 1)
    ring = np.concatenate([rows[:, 0], rows[-1, 1:], rows[-2::-1, -1], rows[0, -2:0:-1]])
    after = np.roll(ring, -1)
    sides = [np.stack([ring, ring + n, after + n], 1), np.stack([ring, after + n, after], 1)]
    lift = np.array([0, 0, thickness / 2])
    return np.concatenate([v + lift, v - lift]), np.concatenate([f, f[:, ::-1] + n, *sides])


def together(*parts):
    """One mesh of several."""
    offsets = np.cumsum([0] + [len(v) for v, _ in parts])
    triangles = [f + offset for (_, f), offset in zip(parts, offsets[:-1], strict=True)]
    return np.concatenate([v for v, _ in parts]), np.concatenate(triangles)


def arc(start, end, degrees):
    """The rigid motion of what lies beyond x = end when the strip from start to end bends up into an arc of
    its own length."""
    angle = np.radians(degrees)
    radius = (end - start) / angle
    motion = cases.turn([0, 1, 0], -degrees)
    place = np.array([start + radius * np.sin(angle), 0, radius * (1 - np.cos(angle))])
    motion[:3, 3] = place - motion[:3, :3] @ np.array([end, 0, 0])
    return motion


def ends(start, end, motion):
    """Handles that hold what lies before x = start and move what lies beyond x = end."""
    return [
        cases.moved(cases.box((-FAR, -FAR, -FAR), (start, FAR, FAR))),
        cases.moved(cases.box((end, -FAR, -FAR), (FAR, FAR, FAR)), motion),
    ]


def edge_ratios(vertices, triangles, moved):
    """Lengths of the moved edges over those at rest."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    lengths = [np.linalg.norm(v[edges[:, 0]] - v[edges[:, 1]], axis=1) for v in (moved, vertices)]
    return lengths[0] / lengths[1]
