# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes for pictures, the demo and tests: smooth unions of round cones, by marching cubes.

Each shape is a function without arguments that returns a Shape: vertices (n,3), triangles (m,3)
counter-clockwise from outside, colours (n,3). z is up, a shape faces -y and is about two units long. Needs
NumPy and scikit-image, no Blender."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


class Shape(NamedTuple):
    vertices: np.ndarray
    triangles: np.ndarray
    colours: np.ndarray


@dataclass(frozen=True)
class Cone:
    """A round cone: a ball of radius `ra` at `a` swept to radius `rb` at `b`."""

    a: tuple
    b: tuple
    ra: float
    rb: float
    colour: tuple | None = None
    blend: float | None = None  # None: that of the shape

    def distance(self, p):
        a, b = np.asarray(self.a, float), np.asarray(self.b, float)
        axis = b - a
        length2 = max(float(axis @ axis), 1e-12)
        along = np.clip((p - a) @ axis / length2, 0.0, 1.0)
        return np.linalg.norm(p - a - along[:, None] * axis, axis=1) - (self.ra + along * (self.rb - self.ra))


@dataclass(frozen=True)
class Ellipsoid:
    centre: tuple
    radii: tuple
    colour: tuple | None = None
    blend: float | None = None

    def distance(self, p):
        q = (p - np.asarray(self.centre)) / np.asarray(self.radii)
        norm = np.linalg.norm(q, axis=1)
        slope = np.linalg.norm(q / np.asarray(self.radii), axis=1)
        return norm * (norm - 1.0) / np.maximum(slope, 1e-9)


@dataclass(frozen=True)
class RoundBox:
    centre: tuple
    half: tuple
    radius: float
    colour: tuple | None = None
    blend: float | None = None

    def distance(self, p):
        q = np.abs(p - np.asarray(self.centre)) - np.asarray(self.half) + self.radius
        outside = np.linalg.norm(np.maximum(q, 0.0), axis=1)
        return outside + np.minimum(q.max(axis=1), 0.0) - self.radius


@dataclass(frozen=True)
class Ring:
    """A torus about an axis parallel to y."""

    centre: tuple
    major: float
    minor: float
    colour: tuple | None = None
    blend: float | None = None

    def distance(self, p):
        q = p - np.asarray(self.centre)
        return np.hypot(np.hypot(q[:, 0], q[:, 2]) - self.major, q[:, 1]) - self.minor


def chain(points, radii, colour=None, blend=None):
    """Round cones along a polyline."""
    pairs = zip(points[:-1], points[1:], radii[:-1], radii[1:], strict=True)
    return [Cone(a, b, ra, rb, colour, blend) for a, b, ra, rb in pairs]


def mirrored(parts):
    """The parts, and their reflections in x."""
    flip = np.array([-1.0, 1.0, 1.0])
    twins = []
    for part in parts:
        if isinstance(part, Cone):
            twins.append(
                Cone(tuple(flip * part.a), tuple(flip * part.b), part.ra, part.rb, part.colour, part.blend)
            )
        else:
            fields = {**vars(part), "centre": tuple(flip * part.centre)}
            twins.append(type(part)(**fields))
    return [*parts, *twins]


def smooth_union(parts, axes, blend):
    """Polynomial smooth minimum on a grid, part by part, each only near itself."""
    reach = 0.25
    values = np.full([len(axis) for axis in axes], reach)
    for part in parts:
        k = max(blend if part.blend is None else part.blend, 1e-9)
        low, high = bounds([part], reach)
        spans = [slice(*np.searchsorted(axis, (a, b))) for axis, a, b in zip(axes, low, high, strict=True)]
        near = values[tuple(spans)]
        if near.size == 0:
            continue
        local = [axis[span] for axis, span in zip(axes, spans, strict=True)]
        points = np.stack(np.meshgrid(*local, indexing="ij"), -1).reshape(-1, 3)
        other = part.distance(points).reshape(near.shape)
        h = np.maximum(k - np.abs(near - other), 0.0) / k
        near[...] = np.minimum(near, other) - h * h * h * k / 6.0
    return values


def build(parts, blend=0.12, carve=(), paint=(), base=(0.7, 0.7, 0.7), cells=110, softness=0.018):
    """The zero set of the smooth union minus `carve`, coloured by the nearest parts and inside `paint`."""
    from skimage.measure import marching_cubes

    low, high = bounds(parts)
    step = (high - low).max() / cells
    axes = [np.arange(a - 2 * step, b + 3 * step, step) for a, b in zip(low, high, strict=True)]
    values = smooth_union(parts, axes, blend)
    if carve:
        values = np.maximum(values, -smooth_union(carve, axes, blend))
    vertices, triangles, _, _ = marching_cubes(values, 0.0, spacing=(step,) * 3)
    vertices = vertices + np.array([axis[0] for axis in axes])
    colours = colours_at(parts, vertices, base, softness)
    for part in paint:
        share = np.clip(0.5 - part.distance(vertices) / softness, 0.0, 1.0)[:, None]
        colours = (1 - share) * colours + share * np.asarray(part.colour)
    return Shape(vertices, triangles.astype(np.int64), colours)


def bounds(parts, margin=0.06):
    lows, highs = [], []
    for part in parts:
        if isinstance(part, Cone):
            ends, reach = np.array([part.a, part.b], float), max(part.ra, part.rb)
        elif isinstance(part, Ring):
            ends, reach = np.array([part.centre], float), part.major + part.minor
        else:
            ends = np.array([part.centre], float)
            reach = np.asarray(part.radii if isinstance(part, Ellipsoid) else part.half)
        lows.append((ends - reach).min(0))
        highs.append((ends + reach).max(0))
    return np.min(lows, 0) - margin, np.max(highs, 0) + margin


def colours_at(parts, points, base, softness):
    """(n, 3) colours of points: of the nearest parts, blended over `softness`; `base` for parts without."""
    distances = np.stack([part.distance(points) for part in parts], 1)
    weights = np.exp(-(distances - distances.min(1, keepdims=True)) / softness)
    palette = np.array([base if part.colour is None else part.colour for part in parts])
    return weights @ palette / weights.sum(1, keepdims=True)


def smooth_path(points, count):
    """A Catmull-Rom spline through the points, with `count` points per span."""
    p = np.asarray([points[0], *points, points[-1]], float)
    t = np.linspace(0, 1, count, endpoint=False)[:, None]
    spans = [
        0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)
        for a, b, c, d in zip(p[:-3], p[1:-2], p[2:-1], p[3:], strict=True)
    ]
    return [tuple(x) for x in np.concatenate([*spans, p[-2:-1]])]


def tube(points, radii, colour=None, count=5, blend=None):
    """A chain along a smooth path; the radii are interpolated."""
    path = smooth_path(points, count)
    where = np.linspace(0, len(points) - 1, len(path))
    return chain(path, list(np.interp(where, range(len(points)), radii)), colour, blend)


# Measures of stylized meshes, z up: agreement with the style, and whether they still stand. Needs NumPy.

GROUND = 0.06  # share of the height below which vertices belong to feet
LEAST_FOOT = 4  # vertices; smaller parts are ignored


def face_normals(vertices, triangles):
    """(m, 3) unit normals and (m,) areas."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    return normals / np.maximum(lengths, 1e-300)[:, None], lengths / 2


def share_along(vertices, triangles, preferred, degrees=10.0):
    """Share of the area whose normal lies within an angle of a preferred one (k, 3)."""
    normals, areas = face_normals(vertices, triangles)
    close = (normals @ preferred.T).max(axis=1) > np.cos(np.radians(degrees))
    return float(areas[close].sum() / areas.sum())


def enclosed(vertices, triangles):
    """Volume of a closed mesh."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def tilt(rest, moved, triangles):
    """Degrees by which the closest rotation of the motion, weighted by area, tilts the z axis."""
    corners = face_normals(rest, triangles)[1] / 3
    weights = np.bincount(triangles.ravel(), np.repeat(corners, 3), len(rest))[:, None]
    arms, wanted = (p - (weights * p).sum(axis=0) / weights.sum() for p in (rest, moved))
    left, _, right = np.linalg.svd((weights * wanted).T @ arms)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    return float(np.degrees(np.arccos(np.clip(turn[2, 2], -1, 1))))


def feet(rest, triangles):
    """Vertex indices of each connected part below GROUND of the rest shape's height."""
    heights = rest[:, 2]
    low = heights < heights.min() + GROUND * np.ptp(heights)
    inside = triangles[low[triangles].all(axis=1)]
    labels = np.arange(len(rest))
    while True:
        least = labels[inside].min(axis=1)
        before = labels.copy()
        for corner in inside.T:
            np.minimum.at(labels, corner, least)
        if np.array_equal(labels, before):
            break
    parts = [np.flatnonzero(labels == label) for label in np.unique(labels[inside])]
    return [part for part in parts if len(part) >= LEAST_FOOT]


def on_the_ground(rest, parts, slack=0.02):
    """The parts whose lowest point is within a share of the height of the lowest of all."""
    low, height = rest[:, 2].min(), np.ptp(rest[:, 2])
    return [part for part in parts if rest[part, 2].min() < low + slack * height]


def unevenness(vertices, parts, height):
    """Range of the heights of the feet's lowest points, as a share of the height; 0 for fewer than two."""
    if len(parts) < 2:
        return 0.0
    return float(np.ptp([vertices[part, 2].min() for part in parts]) / height)
