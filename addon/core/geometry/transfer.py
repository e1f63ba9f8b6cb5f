# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfers to another mesh: marked edges, UV coordinates, and objects at their distance from the surface."""

import heapq
from collections import defaultdict

import numpy as np

# Transfers marked edges of one mesh to paths of nearby edges on another.

ASIDE = 2.0  # cost of distance from the marked edge, relative to path length
LONGEST = 3.0  # longest path, relative to its edge; longer ones are dropped


def carried_marks(ends, values, nearest, vertices, edges):
    """(m,) values for a mesh's edges (m, 2), along the shortest paths between the ends of each marked edge.

    `ends` (k, 2, 3): ends of the marked edges; `nearest` (k, 2): the mesh's vertices nearest to them;
    `values` (k,): of the marked edges; the largest counts where paths overlap.
    """
    about = defaultdict(list)
    for number, (a, b) in enumerate(edges.tolist()):
        about[a].append((b, number))
        about[b].append((a, number))
    result = np.zeros(len(edges))
    for pair, value, (start, goal) in zip(ends, values, nearest.tolist(), strict=True):
        for number in path(pair, start, goal, vertices, about):
            result[number] = max(result[number], value)
    return result


def path(pair, start, goal, vertices, about):
    """Edge indices of the path between two vertices nearest to a straight line; [] if it is too long."""
    if start == goal:
        return []
    along = pair[1] - pair[0]
    size = np.linalg.norm(along) or 1.0
    furthest = LONGEST * max(size, np.linalg.norm(vertices[goal] - vertices[start]))

    def cost(a, b):
        middle = (vertices[a] + vertices[b]) / 2 - pair[0]
        beside = middle - np.clip(middle @ along / size**2, 0, 1) * along
        return np.linalg.norm(vertices[b] - vertices[a]) * (1 + ASIDE * np.linalg.norm(beside) / size)

    reached, queue = {}, [(0.0, start, None, None)]
    while queue:
        length, here, before, number = heapq.heappop(queue)
        if here in reached or length > furthest:
            continue
        reached[here] = before, number
        if here == goal:
            break
        for there, edge in about[here]:
            if there not in reached:
                heapq.heappush(queue, (length + cost(here, there), there, here, edge))
    found = []
    while goal in reached and goal != start:
        goal, number = reached[goal]
        found.append(number)
    return found


# Transfers UV coordinates to the face corners of another mesh, whose faces may cross seams.

# A seam lies between a corner and its face's center if the corner's UV is off the extrapolated one by more
# than this many times the extrapolated change.
CUT = 3.0


def fan(vertices, starts, corners):
    """((n + m, 3) vertices and face centers, (c, 3) triangles, (c,) face of each corner)."""
    counts = np.diff(np.append(starts, len(corners)))
    face = np.repeat(np.arange(len(starts)), counts)
    centres = np.add.reduceat(vertices[corners], starts) / counts[:, None]
    following = np.arange(1, len(corners) + 1)
    following[starts + counts - 1] = starts
    triangles = np.stack([len(vertices) + face, corners, corners[following]], axis=1).astype(np.int32)
    return np.concatenate([vertices, centres]), triangles, face


def corner_coordinates(points, places, shares, corners, face, moved, uv):
    """((c, 2) UVs of face corners, (c,) whether a seam separates the corner from its face's center).

    `points` (n + m, 3) of `fan` lie on triangle `places` (n + m,) at barycentric coordinates `shares`
    (n + m, 3); `moved` (t, 3, 3) are the triangles' corners, `uv` (t, 3, 2) their UVs. Beyond a seam, the UV
    map at the face's center is extrapolated.
    """
    at = (shares[:, :, None] * uv[places]).sum(axis=1)
    centre = len(points) - (face.max() + 1) + face
    own = places[centre]
    sides = moved[own][:, 1:] - moved[own][:, :1]
    slopes = uv[own][:, 1:] - uv[own][:, :1]
    metric = sides @ sides.transpose(0, 2, 1)
    metric += 1e-9 * np.trace(metric, axis1=1, axis2=2)[:, None, None] * np.eye(2) + 1e-30 * np.eye(2)
    offset = points[corners] - points[centre]
    parts = np.linalg.solve(metric, (sides @ offset[:, :, None]))[:, :, 0]
    step = (parts[:, :, None] * slopes).sum(axis=1)
    straight, direct = at[centre] + step, at[corners]
    beyond = np.linalg.norm(direct - straight, axis=1) > CUT * np.linalg.norm(step, axis=1) + 1e-6
    return np.where(beyond[:, None], straight, direct), beyond


# Fits carried objects of a wrapped body to the target body, at the same distance from its surface.

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
