# SPDX-License-Identifier: GPL-3.0-or-later
"""The problems that all are given: a mesh, which of its vertices are held, which are moved, and where to."""

import functools
from typing import NamedTuple

import numpy as np

import arapfields as af

from .. import shapes
from ..shapes import inside, meshes

RESOLUTION = 96
POINT = {  # of the hand whose index finger is pulled by one point: palm's box, point, goal
    True: (((-0.38, -0.43, -0.73), (0.12, 0.47, 0.01)), (0.17, -0.26, 0.54), (0.50, -0.26, 0.28)),
    False: (((-1, -1, -1), (1, 1, 0.05)), (0.2, -0.03, 0.61), (0.2, -0.35, 0.40)),
}


class Problem(NamedTuple):
    name: str  # as rows have it
    shape: str
    vertices: np.ndarray  # (n, 3)
    triangles: np.ndarray  # (m, 3)
    held: np.ndarray  # indices of vertices that stay
    moved: np.ndarray  # indices of vertices that go
    goals: np.ndarray  # (len(moved), 3)
    motion: np.ndarray  # (4, 4) of what goes
    handles: list  # the same for us: cuboids, and a point

    @property
    def fixed(self):
        return np.concatenate([self.held, self.moved])

    @property
    def wanted(self):
        return np.concatenate([self.vertices[self.held], self.goals])


def even_mesh(shape, rounds=12):
    """The shape's surface by marching cubes, its vertices relaxed along it: slivers would be unfair to
    those who work on the mesh."""
    sdf = shapes.sdf(shape)
    vertices, triangles = af.extract_surface(sdf, RESOLUTION)
    ends = np.concatenate([triangles[:, pair] for pair in ((0, 1), (1, 2), (2, 0))])
    count = np.bincount(ends[:, 0], minlength=len(vertices))[:, None]
    for _ in range(rounds):
        total = np.zeros_like(vertices)
        np.add.at(total, ends[:, 0], vertices[ends[:, 1]])
        vertices = (vertices + total / count) / 2
        for _ in range(2):
            slope = sdf.gradient(vertices)
            vertices = vertices - sdf(vertices)[:, None] * slope / (slope**2).sum(1)[:, None]
    return vertices, triangles


@functools.cache
def turned(shape):
    """A part of the shape turned by 70°, its base held: the constraints of figure 7."""
    vertices, triangles = even_mesh(shape)
    (held, moved), goal = shapes.placements(shape), shapes.targets(shape, shapes.FULL)[1]
    rows = np.flatnonzero(inside(moved, vertices))
    motion = goal @ np.linalg.inv(moved)
    goals = vertices[rows] @ motion[:3, :3].T + motion[:3, 3]
    handles = [af.Cuboid(held, held), af.Cuboid(moved, goal)]
    name = f"{shapes.label(shape)}, turned by {shapes.FULL}°"
    fixed = np.flatnonzero(inside(held, vertices))
    return Problem(name, shape, vertices, triangles, fixed, rows, goals, motion, handles)


@functools.cache
def pulled():
    """The hand's index finger pulled by one point, its palm held: the constraints of figure 6."""
    corners, point, goal = POINT[shapes.is_published("hand")]
    palm = shapes.cases.box(*corners)
    vertices, triangles = even_mesh("hand")
    row = np.linalg.norm(vertices - point, axis=1).argmin()
    goals = vertices[[row]] + np.subtract(goal, point)
    handles = [af.Cuboid(palm, palm), af.Point(vertices[row], goals[0])]
    name = f"{shapes.label('hand')}, one finger pulled by a point"
    fixed = np.flatnonzero(inside(palm, vertices))
    motion = shapes.cases.shift(goals[0] - vertices[row])
    return Problem(name, "hand", vertices, triangles, fixed, np.array([row]), goals, motion, handles)


def awkward():
    """Meshes that not all take, by what is odd; lower ends are held, upper ones turned by 40°."""
    vertices, triangles = meshes.sphere(1.0, 3)
    middles = vertices[triangles].mean(1)
    apex = len(vertices)
    fin = np.array([[triangles[40][0], triangles[40][1], apex]])
    other = 0.3 * vertices + np.array([0.9, 0, 0])
    sliver = np.array([[triangles[7][0], triangles[7][0], triangles[7][1]]])
    made = {
        "closed": (vertices, triangles),
        "a hole": without_loose(vertices, triangles[middles[:, 0] < 0.8]),
        "an edge of three triangles": (np.r_[vertices, [1.3 * vertices[fin[0, 0]]]], np.r_[triangles, fin]),
        "two parts that overlap, one without handles": (
            np.r_[vertices, other],
            np.r_[triangles, triangles + len(vertices)],
        ),
        "triangles that share no vertices": (
            vertices[triangles].reshape(-1, 3),
            np.arange(3 * len(triangles)).reshape(-1, 3),
        ),
        "a triangle without area": (vertices, np.r_[triangles, sliver]),
    }
    return {name: ends_turned(name, *mesh) for name, mesh in made.items()}


def without_loose(vertices, triangles):
    used, corners = np.unique(triangles, return_inverse=True)
    return vertices[used], corners.reshape(-1, 3)


def ends_turned(name, vertices, triangles):
    boxes = [shapes.cases.box((-2, -2, low), (2, 2, high)) for low, high in ((-1.1, -0.6), (0.6, 1.5))]
    motion = shapes.cases.turn([0, 1, 0], 40, (0, 0, 0.2))
    held, rows = (np.flatnonzero(inside(box, vertices)) for box in boxes)
    goals = vertices[rows] @ motion[:3, :3].T + motion[:3, 3]
    handles = [af.Cuboid(boxes[0], boxes[0]), af.Cuboid(boxes[1], motion @ boxes[1])]
    return Problem(name, "odd", vertices, triangles, held, rows, goals, motion, handles)


def of_figures():
    return {"figure 6": pulled(), "figure 7": turned("bunny")}
