# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs whose scene the window leaves, or whose file is saved elsewhere, or that lose what they need."""

import contextlib

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import saved_animation, stepped
    from support.blender.stages import Operator
    from support.blender.wraps import SMALL, bar_and_target

    from addon.animation import played
    from addon.core.runtime import jobs
    from addon.deform.operators import ARAPFIELDS_OT_deform
    from addon.wrap.operators import ARAPFIELDS_OT_wrap

pytestmark = pytest.mark.in_blender

FRAMES = 30  # far more than are read ahead


def swelling_bar():
    """A bar that swells by itself while a handle lifts it: each frame is read when its turn comes."""
    bar, folder = saved_animation()
    bar.shape_key_add(name="Basis")
    key = bar.shape_key_add(name="Swell")
    for point in key.data:
        point.co = point.co * 1.3
    for frame, value in ((1, 0.0), (FRAMES, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    bpy.context.scene.frame_set(1)
    return bar, folder / "cache/scene~Scene~Bar.pc2"


def begun(operator):
    """The operator, which runs as in a window."""
    operator.show_progress = lambda *_: None
    operator.set_out(bpy.context)
    return operator


def advanced(operator, until=lambda: False):
    """Advances it until it ends, or that holds; what `advance` returns at last."""
    result = {"RUNNING_MODAL"}
    while result == {"RUNNING_MODAL"} and not until():
        result = operator.advance(bpy.context)
        if jobs.running() is not None:
            jobs.running().join(0.001)
    return result


def bake():
    return begun(stepped(format="PC2", start=1, end=FRAMES, folder="//cache"))


def at_frame(number):
    return lambda: bpy.context.scene.frame_current >= number


@contextlib.contextmanager
def elsewhere():
    """The window shows another scene."""
    window, scene = bpy.context.window, bpy.context.scene
    window.scene = bpy.data.scenes.new("Other")
    assert bpy.context.scene != scene
    try:
        yield
    finally:
        with contextlib.suppress(ReferenceError):  # it was deleted
            window.scene = scene


def only_waits(operator, name="Scene"):
    """Whether an operator says that it waits for that, and does nothing."""
    before = [(scene.frame_current, len(scene.objects)) for scene in bpy.data.scenes]
    results = [operator.advance(bpy.context) for _ in range(20)]
    assert jobs.running().message == f"Waits until the window shows {name}"
    assert [(scene.frame_current, len(scene.objects)) for scene in bpy.data.scenes] == before
    return all(result == {"RUNNING_MODAL"} for result in results)


def test_a_bake_waits_until_its_own_scene_is_shown_again():
    _, path = swelling_bar()
    assert advanced(bake()) == {"FINISHED"}
    expected = path.read_bytes()
    bpy.ops.arapfields.remove_bake()
    running = bake()
    advanced(running, at_frame(4))
    with elsewhere():
        assert only_waits(running)
    assert advanced(running) == {"FINISHED"}, running.said
    assert path.read_bytes() == expected and bpy.context.scene.frame_current == 1


def test_another_view_layer_is_waited_for_as_well():
    _, path = swelling_bar()
    running = bake()
    advanced(running, at_frame(4))
    window, layer = bpy.context.window, bpy.context.view_layer
    window.view_layer = bpy.context.scene.view_layers.new("Other")
    assert only_waits(running, layer.name)
    window.view_layer = layer
    assert advanced(running) == {"FINISHED"} and path.exists()


def test_what_is_cancelled_elsewhere_ends_there():
    _, path = swelling_bar()
    running = bake()
    advanced(running, at_frame(4))
    with elsewhere():
        jobs.running().cancel()
        assert advanced(running) == {"CANCELLED"} and running.said == "Bake cancelled"
    assert jobs.running() is None and not path.parent.exists()
    assert bpy.context.scene.frame_current == 1


def test_a_new_object_comes_into_its_sources_scene():
    bar, _, moving = scenes.bar_with_handles()
    moving.location.z += 0.4
    running = begun(Operator(ARAPFIELDS_OT_deform, **scenes.NEW))
    assert advanced(running, lambda: jobs.running() and jobs.running().items) == {"RUNNING_MODAL"}
    with elsewhere():
        jobs.running().join()
        assert only_waits(running)
    assert advanced(running) == {"FINISHED"}, running.said
    assert "Bar_deformed" in bpy.context.scene.objects and not bar.visible_get()


def test_a_bake_says_that_its_scene_was_deleted():
    _, path = swelling_bar()
    running = bake()
    advanced(running, at_frame(4))
    scene = bpy.context.scene
    with elsewhere():
        bpy.data.scenes.remove(scene)
        assert advanced(running) == {"CANCELLED"}
    assert running.said == "Scene was deleted while it was worked on"
    assert jobs.running() is None and not path.parent.exists()


def test_a_cache_is_found_from_where_the_file_was_saved_meanwhile():
    bar, path = swelling_bar()
    running = bake()
    advanced(running, at_frame(4))
    (path.parents[1] / "later").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(path.parents[1] / "later/scene.blend"))
    assert advanced(running) == {"FINISHED"}
    assert bar.modifiers[0].filepath == f"//../cache/{path.name}" and played.problem(bar) is None


def test_a_bake_says_that_it_lost_a_handle():
    _, path = swelling_bar()
    running = bake()
    advanced(running, at_frame(4))
    scenes.delete(bpy.data.objects["Moving"])
    assert advanced(running) == {"CANCELLED"}
    assert running.said == "Bar changed while it was worked on; run again"
    assert not path.parent.exists()


def swelling_bar_over_a_cube():
    bar, path = swelling_bar()
    bpy.ops.mesh.primitive_cube_add(location=(0, 0, -5))
    cube = bpy.context.object
    scenes.activate(cube, bar)
    assert bpy.ops.arapfields.add_obstacle() == {"FINISHED"}
    bar.arapfields.contact.use = True
    return cube, path


@pytest.mark.parametrize("kind", ["deleted", "taken out", "hidden", "switched off"])
def test_a_bake_says_that_it_lost_an_obstacle(kind):
    cube, path = swelling_bar_over_a_cube()
    running = bake()
    advanced(running, at_frame(4))
    if kind == "deleted":
        scenes.delete(cube)
    elif kind == "hidden":
        cube.hide_set(True)
    elif kind == "switched off":
        cube.hide_viewport = True
    else:
        bpy.ops.arapfields.remove_obstacle()
    assert advanced(running) == {"CANCELLED"}
    assert running.said == "Bar changed while it was worked on; run again"
    assert not path.parent.exists()


@pytest.mark.parametrize("kind", ["keys", "strips", "drivers"])
def test_an_obstacle_may_come_and_go_by_its_animation(kind):
    cube, path = swelling_bar_over_a_cube()
    if kind == "drivers":
        cube.driver_add("hide_viewport").driver.expression = "frame < 10"
    else:
        for frame, hidden in ((1, True), (10, False)):
            cube.hide_viewport = hidden
            cube.keyframe_insert("hide_viewport", frame=frame)
    if kind == "strips":
        data = cube.animation_data
        data.nla_tracks.new().strips.new("Strip", 1, data.action)
        data.action = None
    for frame in (12, 1):
        bpy.context.scene.frame_set(frame)
        assert cube.hide_viewport == (frame == 1)
    running = bake()
    assert advanced(running) == {"FINISHED"} and path.exists(), running.said


@pytest.mark.parametrize("result", ["MODIFIER", "NEW"])
def test_a_wrap_whose_object_is_moved_meanwhile_lies_on_its_target(result):
    """It was said to be near the target, and lay beside it."""
    item, target = bar_and_target()
    item.scale = (1, 1.2, 0.9)
    bpy.context.view_layer.update()
    scenes.activate(item)
    running = begun(Operator(ARAPFIELDS_OT_wrap, onto="", result=result, **SMALL))
    advanced(running, lambda: jobs.running() and jobs.running().items)
    item.location, item.rotation_euler = (0, 0, 2), (0, 0, 1)
    bpy.context.view_layer.update()
    assert advanced(running) == {"FINISHED"}, running.said
    shown = bpy.data.objects["Bar_wrapped"] if result == "NEW" else item
    corners = [
        np.array([points.min(axis=0), points.max(axis=0)])
        for points in map(scenes.world_points, (shown, target))
    ]
    assert np.abs(corners[0] - corners[1]).max() < 0.1
