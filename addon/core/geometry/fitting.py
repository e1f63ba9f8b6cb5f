# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits carried objects of a wrapped body to the target body, at the same distance from its surface."""

import numpy as np

REACH = 0.05  # of the diagonal: distance from the surface over which the fit fades to the wrap alone
MISSING = 0.02  # of the diagonal: a target farther from the wrapped body has a gap there
ROUNDS, SMOOTHINGS = 3, 5
NEIGHBOURS = 30  # body vertices whose median scale a rigid object takes
LEAST = 0.5  # of the wanted distance: nearer vertices are pushed out without smoothing


class Body:
    """`wrapped`: (rest, moved, triangles) of the source, `onto`: (vertices, triangles) of the target; in
    world space."""

    def __init__(self, af, wrapped, onto):
        self.af, (self.rest, self.moved, self.triangles) = af, wrapped
        self.diagonal = float(np.linalg.norm(np.ptp(onto[0], axis=0)))
        self.own, self.other = af.MeshSdf(self.rest, self.triangles), af.MeshSdf(*onto)
        areas = [vertex_areas(shape, self.triangles) for shape in (self.rest, self.moved)]
        self.scale = np.sqrt(areas[1] / np.maximum(areas[0], 1e-30))  # (n,) at the source's vertices
        self.away = np.abs(self.other(self.moved)) / self.diagonal

    def placed(self, rest, now):
        """(scale, (3,) translation) of a rigid object; `rest` and `now` (3,) are its center."""
        near = np.linalg.norm(self.rest - rest, axis=1)
        scale = float(np.median(self.scale[np.argsort(near)[:NEIGHBOURS]]))
        wanted, there = float(self.own(rest[None])[0]) * scale, now[None]
        share = np.exp(-((wanted / (REACH * self.diagonal)) ** 2))
        return scale, share * (wanted - float(self.other(there)[0])) * self.other.gradient(there)[0]

    def wanted(self, rest, triangles):
        """(n,) wanted signed distances of a carried mesh's vertices from the target, and (n,) their weights,
        which fall off far from the surface and at gaps of the target."""
        body = self.rest, self.triangles
        places = self.af.Correspondence(self.rest, body, (rest, triangles))
        wanted = self.own(rest) * places.values(self.scale)
        off = wanted / (REACH * self.diagonal), places.values(self.away) / MISSING
        return wanted, np.exp(-(off[0] ** 2) - off[1] ** 2)

    def fit(self, rest, moved, triangles):
        """(n, 3) fitted vertices of a carried mesh, from those at rest and those moved by the wrap's field.

        Vertices that coincide at rest stay together.
        """
        _, first, joined = np.unique(rest, axis=0, return_index=True, return_inverse=True)
        if len(first) < len(rest):
            return self.fit(rest[first], moved[first], joined.ravel()[triangles])[joined.ravel()]
        (wanted, near), shape = self.wanted(rest, triangles), np.array(moved, float)
        edges = np.unique(np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
        for _ in range(ROUNDS):
            push = (near * (wanted - self.other(shape)))[:, None] * self.other.gradient(shape)
            for _ in range(SMOOTHINGS):
                push = smoothed(push, edges)
            shape += push
        least = LEAST * near * wanted
        for _ in range(ROUNDS):
            self.push_out(shape, np.arange(len(shape))[:, None], least)
            self.push_out(shape, triangles, least[triangles].mean(axis=1))
        return shape

    def push_out(self, shape, groups, least):
        """Pushes groups (m, k) of vertices out until their centers are `least` (m,) from the target."""
        outside = np.flatnonzero(least > 0)
        middles = shape[groups[outside]].mean(axis=1)
        lack = least[outside] - self.other(middles)
        short = np.flatnonzero(lack > 0)
        push = lack[short, None] * self.other.gradient(middles[short])
        moves, counts = np.zeros_like(shape), np.zeros(len(shape))
        for corner in groups[outside[short]].T:
            np.add.at(moves, corner, push)
            np.add.at(counts, corner, 1)
        shape += moves / np.maximum(counts, 1)[:, None]


def smoothed(values, edges):
    """(n, k) vertex values, each averaged with the mean of its neighbours."""
    sums, counts = np.zeros_like(values), np.zeros(len(values))
    for here, there in (edges.T, edges.T[::-1]):
        np.add.at(sums, here, values[there])
        np.add.at(counts, here, 1)
    return np.where(counts[:, None] > 0, 0.5 * (values + sums / np.maximum(counts, 1)[:, None]), values)


def vertex_areas(vertices, triangles):
    """(n,) vertex areas: a third of the adjacent triangles'."""
    corners = vertices[triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return np.bincount(triangles.ravel(), np.repeat(areas, 3), minlength=len(vertices)) / 6
