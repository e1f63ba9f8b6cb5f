# SPDX-License-Identifier: GPL-3.0-or-later
"""Secondary motion by a source's settings: each frame is a time step from the one before."""

from math import ceil
from typing import Any, NamedTuple

import numpy as np

from ..blender.object_references import settings_of
from ..blender.property_definitions import from_single_precision
from ..core.geometry.spaces import inverse, pose

# Secondary motion by a source's settings.


class SecondaryMotion(NamedTuple):
    """Native options of the motion, and the source's placement in the world; in solve space."""

    options: tuple  # ((name, value) of the native options)
    up: tuple  # (3,) the world's up direction
    ground: float | None  # height along `up`
    world: tuple  # (4, 4) solve → world, flattened row by row

    def coordinates_since(self, earlier):
        """(4, 4) rigid: `earlier`'s solve space → the present one; None if the source has not moved."""
        if self.world == earlier.world:
            return None
        now, then = (np.reshape(motion.world, (4, 4)) for motion in (self, earlier))
        return pose(inverse(now) @ then)


def is_used(source):
    settings = settings_of(source).secondary
    return settings.use and settings.strength > 0.0


def motion_of(settings, space):
    """The SecondaryMotion of an object's settings, original or evaluated for a render; or None."""
    group = settings.secondary
    if not group.use or group.strength == 0.0:
        return None
    world = space.solve_to_world
    scale = float(np.cbrt(abs(np.linalg.det(world[:3, :3]))))
    strength, damping, gravity, ground = (
        from_single_precision(value) for value in (group.strength, group.damping, group.gravity, group.ground)
    )
    options = (("strength", strength), ("damping", damping), ("gravity", gravity / scale))
    rise = float(np.linalg.norm(world[2, :3]))
    height = (ground - world[2, 3]) / rise if group.use_ground else None
    up = tuple((world[2, :3] / rise).tolist())
    return SecondaryMotion(options, up, height, tuple(world.ravel().tolist()))


def group_names(source):
    """[vertex group with each vertex's share of secondary motion], or []."""
    group = settings_of(source).secondary.group
    return [group] if is_used(source) and group else []


def layout_of(source, scene):
    """Settings that all simulated frames share; after a change the frames are solved again."""
    settings = settings_of(source).secondary
    return (settings.group, settings.start, frame_rate(scene)) if is_used(source) else None


def frame_rate(scene):
    return scene.render.fps / scene.render.fps_base


# Solves a source frame by frame; with secondary motion each frame is a time step from a whole one before.
#
# Up to the start frame, shapes are solved from rest. Each later frame is one time step from the last whole
# frame, so that subframes have no effect on later frames, and live mode and bakes agree bit for bit.

GAP = 12  # longest time step, in frames, over frames that playback has dropped


class Moment(NamedTuple):
    """The state from which the next frame is stepped."""

    state: Any  # native MotionState
    motion: Any  # SecondaryMotion, with the source's placement in the world
    is_exact: bool  # whether every whole frame since the start frame was stepped


class Simulation:
    """Cache of an animation's moments from a start frame on; not thread-safe."""

    def __init__(self, start, fps):
        self.start, self.fps = start, fps
        self.moments = {}  # whole frame: Moment
        self.edition = 0  # how often moments were forgotten

    def shape(self, solver, frame, request, task=None):
        """The shape of a frame, solved by a FrameSolver; caches the moment of a whole frame."""
        before, edition = self.before(frame), self.edition
        if before is None:
            shape, is_exact = solver.solve_from_rest(request, task), frame <= self.start
        else:
            moment = self.moments[before]
            solver.step(request, (frame - before) / self.fps, moment.motion, moment.state, task)
            shape = solver.exact_shape(request)
            is_exact = moment.is_exact and frame - before <= 1
        if frame == int(frame) and edition == self.edition:
            self.moments[int(frame)] = Moment(solver.solver.motion_state, request.motion, is_exact)
        return shape

    def before(self, frame):
        """The frame from which this one is stepped; None if it begins at rest."""
        if frame <= self.start:
            return None
        last = ceil(frame) - 1
        first = max(self.start, last - GAP + 1)
        return next((one for one in range(last, first - 1, -1) if one in self.moments), None)

    def could_be_exact(self, frame):
        """Whether the moment before this frame is cached and exact, or the frame is solved from rest."""
        before = self.before(frame)
        return frame <= self.start or (
            before is not None and frame - before <= 1 and self.moments[before].is_exact
        )

    def forget(self, frame):
        """Drops the moments of that frame and all later ones, after an edit of the animation."""
        self.edition += 1
        for one in [one for one in list(self.moments) if one >= frame]:
            del self.moments[one]


class Poses:
    """Frames without secondary motion, solved from rest; a request like the last one reuses its shape."""

    last = None  # Shape

    def shape(self, solver, request, task=None):
        if self.last is None or not request.is_like(self.last.of):
            self.last = solver.solve_from_rest(request, task)
        return self.last
