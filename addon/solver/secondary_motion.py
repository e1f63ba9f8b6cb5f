# SPDX-License-Identifier: GPL-3.0-or-later
"""Secondary motion of a source, as its settings ask for it."""

from typing import NamedTuple

import numpy as np

from ..blender.object_references import settings_of
from ..blender.property_definitions import from_single_precision
from ..core.geometry.spaces import inverse, pose


class SecondaryMotion(NamedTuple):
    """Options of the motion, and where the source is in the world; in solve space."""

    options: tuple  # ((name, value) of the native options)
    up: tuple  # (3,) the world's
    ground: float | None  # height along `up`
    world: tuple  # solve → world, row by row

    def coordinates_since(self, earlier):
        """(4, 4) rigid: solve space then → solve space now, where the source has moved in the world."""
        if self.world == earlier.world:
            return None
        now, then = (np.reshape(motion.world, (4, 4)) for motion in (self, earlier))
        return pose(inverse(now) @ then)


def is_used(source):
    settings = settings_of(source).secondary
    return settings.use and settings.strength > 0.0


def motion_of(settings, space):
    """The SecondaryMotion that an object's settings, maybe as a render has them, ask for; or None."""
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
    """The vertex group that says how much of the motion each part has, if there is one."""
    group = settings_of(source).secondary.group
    return [group] if is_used(source) and group else []


def layout_of(source, scene):
    """What all simulated frames have in common; where it changes, they are solved again."""
    settings = settings_of(source).secondary
    return (settings.group, settings.start, frame_rate(scene)) if is_used(source) else None


def frame_rate(scene):
    return scene.render.fps / scene.render.fps_base
