# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings that are keyed or driven: each frame has its own value, live and baked alike."""

from itertools import pairwise

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import at, cache_file
    from support.blender.live import step

    from addon.solver import setup

pytestmark = pytest.mark.in_blender

SAME = 1e-6  # of a shape of size 2: single precision
FRAMES = 1, 2, 3
SETTINGS = {  # {what: (kind of shape, group of settings, property, values at the first and the last frame)}
    "stiffness": ("DEFORM", "deform", "bending", (0.2, 8.0)),
    "locality": ("DEFORM", "deform", "locality", (0.0, 0.3)),
    "margin": ("DEFORM", "contact.obstacle_list[0]", "margin", (0.0, 0.15)),
    "style": ("STYLIZE", "stylize", "strength", (0.1, 0.9)),
}


def bent_bar():
    """A bar whose right end is lifted below a box that is in the way."""
    setup.SAMPLES = 500
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(1.0, 0.0, 1.15))
    scenes.activate(bpy.context.object, bar)
    bpy.ops.arapfields.add_obstacle()
    moving.location.z += 0.6
    bpy.context.view_layer.update()
    scenes.activate(bar)
    return bar


def ball():
    setup.SAMPLES = 500
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    return bpy.context.object


def vary(bar, group, name, values, is_driven):
    """Keys a property from one value to another, or drives it by the frame."""
    owner = bar.arapfields.path_resolve(group)
    if not is_driven:
        for frame, value in zip(FRAMES[::2], values, strict=True):
            setattr(owner, name, value)
            assert owner.keyframe_insert(name, frame=frame)
        return
    first, last = values
    curve = owner.driver_add(name)
    curve.driver.type = "SUM"
    variable = curve.driver.variables.new()
    target = variable.targets[0]
    target.id_type, target.id, target.data_path = "SCENE", bpy.context.scene, "frame_current"
    line = curve.modifiers[0] if curve.modifiers else curve.modifiers.new("GENERATOR")
    slope = (last - first) / (FRAMES[-1] - FRAMES[0])
    line.coefficients = (first - slope * FRAMES[0], slope)


@pytest.mark.parametrize("is_driven", [False, True])
@pytest.mark.parametrize("what", SETTINGS)
def test_each_frame_has_its_own_value_live_and_baked(what, is_driven):
    kind, group, name, values = SETTINGS[what]
    bar = ball() if kind == "STYLIZE" else bent_bar()
    bar.arapfields.contact.use = what == "margin"
    vary(bar, group, name, values, is_driven)
    bpy.context.scene.frame_set(FRAMES[0])
    bpy.ops.arapfields.live(kind=kind)
    live = []
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        step(refined=True)
        live.append(at(bar, frame))
    bpy.ops.arapfields.live(kind=kind)
    scenes.activate(bar)
    given = {"start": FRAMES[0], "end": FRAMES[-1], "kind": kind}
    assert bpy.ops.arapfields.bake(format="PC2", filepath=cache_file(), **given) == {"FINISHED"}
    baked = [at(bar, frame) for frame in FRAMES]
    assert all(np.abs(a - b).max() > 1e-3 for a, b in pairwise(live))
    assert max(np.abs(a - b).max() for a, b in zip(live, baked, strict=True)) < SAME
