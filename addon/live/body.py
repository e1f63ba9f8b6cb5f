# SPDX-License-Identifier: GPL-3.0-or-later
"""Secondary motion of a live source: what its settings ask of the solver."""

from typing import NamedTuple

import numpy as np

from ..blender.object_references import settings_of
from ..blender.property_definitions import from_single_precision
from ..core.geometry.spaces import inverse, pose


class Body(NamedTuple):
    """What a source is as a body, in solve space; where two are equal, so is what they feel."""

    options: tuple  # ((name, value) of the native options)
    up: tuple  # (3,) the world's
    ground: float | None  # height along `up`
    world: tuple  # solve → world, a similarity, row by row

    def coordinates_since(self, earlier):
        """(4, 4) rigid: solve space then → solve space now, where the source has moved in the world."""
        if self.world == earlier.world:
            return None
        matrices = [np.reshape(one.world, (4, 4)) for one in (self, earlier)]
        return pose(inverse(matrices[0]) @ matrices[1])


def is_body(source):
    settings = settings_of(source).secondary
    return settings.use and settings.strength > 0.0


def body_of(settings, space):
    """The Body that the settings, maybe as a render has them, ask for; None for none."""
    group = settings.secondary
    if not group.use or group.strength == 0.0:
        return None
    world = space.solve_to_world
    scale = float(np.cbrt(abs(np.linalg.det(world[:3, :3]))))
    up = world[2, :3] / scale
    strength, damping, gravity = (
        from_single_precision(value) for value in (group.strength, group.damping, group.gravity)
    )
    options = (("strength", strength), ("damping", damping), ("gravity", gravity / scale))
    ground = (from_single_precision(group.ground) - world[2, 3]) / scale if group.use_ground else None
    return Body(options, tuple(map(float, up)), ground, tuple(map(float, world.ravel())))


def group_names(source):
    """The vertex group that says how much of the motion each part has, if there is one."""
    group = settings_of(source).secondary.group
    return [group] if is_body(source) and group else []


def layout_of(source, scene):
    """What the frames that were simulated have in common; where it changes, they are made anew."""
    settings = settings_of(source).secondary
    if not is_body(source):
        return None
    return settings.group, settings.start, frame_rate(scene)


def frame_rate(scene):
    return scene.render.fps / scene.render.fps_base
