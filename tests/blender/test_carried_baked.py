# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes into shape keys of carried meshes that modifiers refine."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import step

    from addon.blender import modifier_stack
    from addon.core.runtime import jobs
    from addon.field_modifier import inputs

pytestmark = pytest.mark.in_blender


def test_hair_and_hooks_are_on_the_baked_object_and_what_is_bound_is_named():
    bar, _, _ = scenes.bar_with_handles()
    sleeve = scenes.bar("Sleeve", 0.6)
    hook, cage = bpy.data.objects.new("Hook", None), scenes.bar("Cage", 0.9)
    cage.scale = (1.0, 2.0, 2.0)
    bpy.context.collection.objects.link(hook)
    scenes.activate(sleeve)
    sleeve.modifiers.new("Finer", "SUBSURF")
    sleeve.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = sleeve.particle_systems[0].settings
    settings.type, settings.count, sleeve.particle_systems[0].seed = "HAIR", 40, 7
    sleeve.modifiers.new("Cloth", "COLLISION")
    sleeve.collision.damping = 0.25
    scenes.activate(sleeve, bar)
    bpy.ops.arapfields.carry()
    bpy.context.scene.frame_set(1)
    bpy.ops.arapfields.deform(**scenes.QUICK)
    hooked, bound = sleeve.modifiers.new("Hook", "HOOK"), sleeve.modifiers.new("Bound", "SURFACE_DEFORM")
    hooked.object, bound.target = hook, cage
    hooked.vertex_indices_set([0, 5, 9])
    bpy.context.view_layer.update()
    scenes.activate(sleeve)
    assert bpy.ops.object.surfacedeform_bind(modifier="Bound") == {"FINISHED"}
    scenes.activate(bar)
    assert bpy.ops.arapfields.bake(format="KEYS", start=1, end=2) == {"FINISHED"}
    baked = bpy.data.objects["Sleeve_baked"]
    behind = modifier_stack.behind(sleeve)
    assert [one.name for one in baked.modifiers] == [one.name for one in behind]
    assert list(baked.modifiers["Hook"].vertex_indices) == [0, 5, 9]
    assert ("WARNING", "Bar: Sleeve_baked: bind or comb Bound again") in jobs.messages(), jobs.messages()
    assert baked.collision.damping == 0.25
    (hair,) = baked.particle_systems
    assert (hair.settings, hair.seed) == (settings, 7)


def test_modifiers_behind_the_field_act_on_the_baked_object_too():
    bar, _, moving = scenes.bar_with_handles()
    sleeve = scenes.bar("Sleeve", 0.6)
    laid = sleeve.modifiers.new("Laid", "SHRINKWRAP")
    laid.target, laid.wrap_mode, laid.offset = bar, "OUTSIDE", 0.05
    sleeve.modifiers.new("Finer", "SUBSURF")
    inputs.put(scenes.reading_nodes(sleeve, bar), "Share", 0.25)
    scenes.activate(sleeve, bar)
    bpy.ops.arapfields.carry()
    for frame, height in ((1, 0.0), (3, 0.4)):
        moving.location.z += height
        moving.keyframe_insert("location", frame=frame)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    live = {}
    for frame in (1, 3):
        bpy.context.scene.frame_set(frame)
        step(refined=True)
        step(refined=True)
        live[frame] = scenes.world_points(sleeve)
    bpy.ops.arapfields.live()
    for _ in range(2):
        scenes.activate(bar)
        assert bpy.ops.arapfields.bake(format="KEYS", start=1, end=3) == {"FINISHED"}
        baked = bpy.data.objects["Sleeve_baked"]
        assert [one.type for one in baked.modifiers] == ["SHRINKWRAP", "SUBSURF", "NODES"]
        read = [inputs.get(baked.modifiers["Nodes"], name) for name in ("Goal", "Share")]
        assert read == [bpy.data.objects["Bar_baked"], 0.25]
        for frame, points in live.items():
            bpy.context.scene.frame_set(frame)
            bpy.context.view_layer.update()
            assert np.abs(scenes.world_points(baked) - points).max() < 0.01
