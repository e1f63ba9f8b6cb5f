# SPDX-License-Identifier: GPL-3.0-or-later
"""Secondary motion by a source's settings."""

from typing import NamedTuple

import numpy as np

from ..blender.object_references import settings_of
from ..blender.property_definitions import from_single_precision
from ..core.geometry.spaces import inverse, pose


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
