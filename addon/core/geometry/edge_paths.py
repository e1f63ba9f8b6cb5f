# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfers marked edges of one mesh to paths of nearby edges on another."""

import heapq
from collections import defaultdict

import numpy as np

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
