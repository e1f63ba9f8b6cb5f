# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes of secondary motion whose last frame is the first again."""

from dataclasses import replace

import numpy as np

from ..core.errors import UserError
from ..solver.simulation import Moment

ROUNDS = 12  # times that an animation is gone through at most
# Of the size: the last frame is that near the first, and what is left, of which single steps have as much, is
# spread over the frames.
CLOSED = 2e-3


def solve(solver, simulation, frames, keep, task=None):
    """Goes through the frames, [(frame, request, whether it is baked)], until the motion repeats itself; each
    baked shape then goes to `keep`. UserError where it does not. All shapes are in memory at once."""
    start, request, _ = frames[0]
    simulation.start = int(start)
    first = simulation.shape(solver, start, request, task)
    size = np.ptp(first.points, axis=0).max()
    repeats = comes_back(request, frames[-1][1], CLOSED * size)
    for _ in range(ROUNDS if repeats else 0):
        shapes = [first]
        for frame, asked, _ in frames[1:]:
            shapes.append(simulation.shape(solver, frame, asked, task))
        first, left = shapes[-1], shapes[0].points - shapes[-1].points
        simulation.moments = {int(start): Moment(solver.solver.motion_state, request.motion, True)}
        if np.abs(left).max() < CLOSED * size:
            break
    else:
        raise UserError(
            "The last frame does not come back to the first; loop the animation, or raise Damping"
        )
    for (frame, _, is_baked), shape in zip(frames, shapes, strict=True):
        if is_baked:
            share = np.float32((frame - start) / max(frames[-1][0] - start, 1.0))
            keep(replace(shape, points=shape.points + share * left))


def comes_back(first, last, near):
    """Whether the handles and the object itself are where they began."""
    pairs = list(zip(first.targets, last.targets, strict=True))
    if first.motion is not None and last.motion is not None:
        pairs.append((first.motion.world, last.motion.world))
    return all(np.allclose(one, other, rtol=0.0, atol=near) for one, other in pairs)
