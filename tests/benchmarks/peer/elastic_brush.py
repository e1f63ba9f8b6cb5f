# SPDX-License-Identifier: GPL-3.0-or-later
"""A stroke of Blender's Elastic Deform brush: a regularised Kelvinlet (de Goes and James 2017)."""

import numpy as np

POISSON = 0.4  # of the material; .5 keeps the volume
RADIUS = 0.1  # of the brush, over the size: a finger's length


def grabbed(points, centre, pull, radius):
    """The points moved by a grab of this radius that takes the centre along by `pull`."""
    away = points - centre
    far = np.sqrt((away**2).sum(1, keepdims=True) + radius**2)
    b = 1 / (4 * (1 - POISSON))
    along = (away @ pull)[:, None] * away
    moved = ((1 - b) / far + radius**2 / (2 * far**3)) * pull + b / far**3 * along
    at_centre = (1 - b) / radius + 1 / (2 * radius)
    return points + moved / at_centre


def stroke(problem):
    """One grab that takes the pulled vertex to its goal."""
    (row,), (goal,) = problem.moved, problem.goals
    centre = problem.vertices[row]
    radius = RADIUS * np.ptp(problem.vertices, axis=0).max()
    return grabbed(problem.vertices, centre, goal - centre, radius)
