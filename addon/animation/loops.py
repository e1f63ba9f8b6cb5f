# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes of looping secondary motion, whose last frame equals the first."""

from dataclasses import replace

import numpy as np

from ..core.errors import UserError
from ..solver.simulation import Moment

ROUNDS = 12  # most passes through the animation
# Largest distance of the last frame from the first, as a share of the size. The remaining gap is distributed
# over the frames; it is comparable to the error of a single step.
CLOSED = 2e-3


def solve(solver, simulation, frames, keep, task=None):
    """Simulates the frames, [(frame, request, whether it is baked)], in rounds until the motion repeats; then
    passes each baked shape to `keep`. UserError if it does not repeat. Holds all shapes in memory."""
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
    """Whether the handles and the object end where they started."""
    pairs = list(zip(first.targets, last.targets, strict=True))
    if first.motion is not None and last.motion is not None:
        pairs.append((first.motion.world, last.motion.world))
    return all(np.allclose(one, other, rtol=0.0, atol=near) for one, other in pairs)
