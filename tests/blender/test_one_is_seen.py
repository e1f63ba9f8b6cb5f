# SPDX-License-Identifier: GPL-3.0-or-later
"""Of a source, its live shape and its results, one is seen in one place, and the one that it seems to be."""

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import step

    from addon.core.runtime import jobs

pytestmark = pytest.mark.in_blender


def seen():
    """Names of the meshes in the viewport, which are those in renders."""
    meshes = [item for item in bpy.context.scene.objects if item.type == "MESH"]
    shown = [item.name for item in meshes if item.visible_get()]
    assert shown == [item.name for item in meshes if not item.hide_render]
    return shown


def test_each_result_takes_the_place_of_the_one_before():
    bar, _, moving = scenes.bar_with_handles()
    moving.location.z += 0.4
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**scenes.NEW)
    assert seen() == ["Bar_deformed"] and "Bar is hidden" in jobs.messages()[-1][1]
    bpy.ops.arapfields.stylize(style="CUBE", **scenes.NEW)
    assert seen() == ["Bar_stylized"] and "Bar_deformed is hidden" in jobs.messages()[-1][1]
    scenes.activate(bar)
    bpy.ops.arapfields.deform(**scenes.NEW)
    assert seen() == ["Bar_deformed"]
    scenes.activate(bar)
    bpy.ops.arapfields.deform(**scenes.QUICK, result="MODIFIER")
    assert seen() == ["Bar"] and bar.modifiers


def test_what_the_user_has_moved_aside_or_hidden_stays_so():
    bar, *_ = scenes.bar_with_handles()
    bpy.ops.arapfields.deform(**scenes.NEW)
    bpy.data.objects["Bar_deformed"].location.y = 2.0
    bpy.context.view_layer.update()
    scenes.activate(bar)
    bpy.ops.arapfields.stylize(style="CUBE", **scenes.NEW)
    assert seen() == ["Bar_deformed", "Bar_stylized"]
    bpy.data.objects.remove(bpy.data.objects["Bar_stylized"])
    bpy.data.objects.remove(bpy.data.objects["Bar_deformed"])
    bar.arapfields.set_aside = False  # hidden by the user
    scenes.activate(bar)
    bpy.ops.arapfields.deform(**scenes.QUICK, result="MODIFIER")
    assert seen() == []


def test_live_mode_shows_its_shape_alone_and_gives_back_what_was_seen():
    bar, _, moving = scenes.bar_with_handles()
    moving.location.z += 0.4
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**scenes.NEW)
    for target, shown in (("NEW", "Bar_live"), ("MODIFIER", "Bar")):
        bar.arapfields.result = target
        scenes.activate(bar)
        bpy.ops.arapfields.live()
        step()
        assert seen() == [shown]
        bpy.ops.arapfields.live()
        assert seen() == ["Bar_deformed"] and not bar.modifiers
    bpy.ops.arapfields.live()
    step()
    bpy.ops.arapfields.live_keep()
    assert seen() == ["Bar"] and bar.modifiers


def test_a_render_sees_the_source_again_when_it_takes_the_result_itself():
    """A deleted result leaves its source hidden in renders, which Alt H does not undo."""
    bar, *_ = scenes.bar_with_handles()
    bpy.ops.arapfields.deform(**scenes.NEW)
    bpy.data.objects.remove(bpy.data.objects["Bar_deformed"])
    bar.hide_set(False)
    scenes.activate(bar)
    bpy.ops.arapfields.deform(**scenes.QUICK, result="MODIFIER")
    assert seen() == ["Bar"]


@pytest.mark.parametrize("way", ["excluded", "collection", "eye", "disabled"])
def test_a_source_stays_where_its_result_cannot_be_seen(way):
    bar, _, moving = scenes.bar_with_handles()
    bpy.ops.arapfields.deform(**scenes.NEW)
    result = bpy.data.objects["Bar_deformed"]
    before = scenes.world_points(result)
    home = bpy.context.view_layer.layer_collection.children[result.users_collection[0].name]
    if way == "excluded":
        home.exclude = True
    elif way == "collection":
        home.hide_viewport = True
    elif way == "eye":
        result.hide_set(True)
    else:
        result.hide_viewport = True
    bar.hide_set(False)
    bar.hide_render = False
    moving.location.z += 0.4
    scenes.activate(bar)
    assert bpy.ops.arapfields.deform(**scenes.NEW) == {"FINISHED"}
    assert "(Bar_deformed is hidden)" in jobs.messages()[-1][1]
    assert bar.visible_get() and not bar.hide_render and not result.visible_get()
    home.exclude = home.hide_viewport = result.hide_viewport = False
    result.hide_set(False)
    assert scenes.world_points(result)[:, 2].max() > before[:, 2].max() + 0.3
