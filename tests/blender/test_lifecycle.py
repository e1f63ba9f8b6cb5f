# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension enabled and disabled in any state, and what users may do at every stage."""

import inspect
import re
import time

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from bl_ui.space_toolsystem_toolbar import VIEW3D_PT_tools_active as toolbar
    from support.blender import scenes, stages
    from support.blender.live import WAIT
    from support.blender.stages import again, source, stray

    import addon
    from addon import lifecycle
    from addon.blender import host, icons
    from addon.core.runtime import jobs, native, threads
    from addon.handles import held_counts, overlays
    from addon.jobs.display import display
    from addon.live import sessions
    from addon.live.live_solver import prefetch
    from addon.pin_tool import drag, hover, tool

pytestmark = pytest.mark.in_blender

# Enabled and disabled again and again, in whatever state: nothing of the extension is left in Blender.

ROUNDS = 3
STATES = ["idle", "live", "job", "counting", "drag", "prefetch"]


def remains():
    """All that the extension has in this Blender: {kind: names}."""

    def of_addon(function):
        return (getattr(function, "__module__", "") or "").startswith("addon")

    handlers = {
        name: [function for function in functions if of_addon(function)]
        for name, functions in inspect.getmembers(bpy.app.handlers, lambda value: isinstance(value, list))
    }
    configurations = bpy.context.window_manager.keyconfigs
    maps = [config.keymaps for config in (configurations.addon, configurations.user) if config]
    types = [name for name in dir(bpy.types) if re.match(r"ARAPFIELDS_", name)]
    subclasses = [
        cls
        for base in (bpy.types.Operator, bpy.types.Panel, bpy.types.Menu, bpy.types.PropertyGroup)
        for cls in base.__subclasses__()
        if of_addon(cls) and cls.is_registered
    ]
    remaining = {f"handler {name}": functions for name, functions in handlers.items()}
    return remaining | {
        "types": types + subclasses,
        "operators": dir(bpy.ops.arapfields),
        "property": [o for o in (bpy.types.Object, bpy.types.Scene) if hasattr(o, "arapfields")],
        "tools": pin_tools(),
        "timers": host.running(),
        "threads": threads.own_threads(),
        "drawings": lifecycle._drawn,
        "pictures": icons._collections,
        "state": [state for state in lifecycle.STATE if is_busy(state)],
        "key maps": [
            item.idname
            for keymaps in maps
            for keymap in keymaps
            for item in keymap.keymap_items
            if item.idname.startswith("arapfields.")
        ],
        "menus": [
            function
            for name in dir(bpy.types)
            for function in getattr(getattr(getattr(bpy.types, name), "draw", None), "_draw_funcs", [])
            if of_addon(function)
        ],
    }


def pin_tools():
    """The extension's tools in Object Mode's toolbar."""
    flat = toolbar._tools_flatten(toolbar._tools["OBJECT"])
    return [tool.idname for tool in flat if tool and tool.idname.startswith("arapfields")]


def is_busy(state):
    """Whether one of lifecycle.STATE holds anything."""
    if state is prefetch:
        return state._thread is not None
    if state is hover.hover:
        return state.target is not None or state.drag is not None
    if state is jobs.board:
        return state.job is not None
    if state is display:
        return state._timer is not None or bool(state._previews)
    if state is overlays.shown:
        return state.mesh is not None
    return bool(state._started) if state is host else bool(state)


def enter(state):
    """Puts the scene into a state in which there is something to end."""
    bar, *_ = scenes.bar_with_handles()
    if state == "live":
        assert bpy.ops.arapfields.live() == {"FINISHED"}
    elif state == "prefetch":
        prefetch.prepare(bpy.context, bar)
    elif state == "drag":
        before = drag.Snapshot(bpy.context, bar, *drag.make_way(bpy.context, bar))
        hover.hover.drag = drag.Drag(bpy.context, before, bpy.data.objects["Moving"])
        hover.hover.drag.move(bpy.context, (1.0, 0.0, 0.3))
    elif state == "job":

        def work(tracker):
            task = tracker.start("Waiting", 1.0)
            while not task.cancelled:
                pass

        jobs.begin(jobs.Job("Deform", [jobs.Item("Bar", work)], native.library().Task))
    elif state == "counting":
        held_counts.points_inside = lambda *_: time.sleep(0.1) or {}
        coroutine = held_counts.pending[bar.session_uid] = held_counts.counting(bpy.context, bar)
        while not any("counting" in thread.name for thread in threads.own_threads()):
            next(coroutine)


@pytest.mark.parametrize("state", STATES)
def test_nothing_is_left_when_the_extension_is_disabled(state):
    enabled, points_inside = None, held_counts.points_inside
    for _ in range(ROUNDS):
        left = {kind: len(names) for kind, names in remains().items()}
        enabled = enabled or left
        assert left == enabled  # nothing is left twice
        assert left["types"] > 25 and left["handler load_pre"] == 1
        enter(state)
        addon.unregister()
        for kind, names in remains().items():
            assert not names, (state, kind, names)
        held_counts.points_inside = points_inside
        bpy.ops.wm.read_factory_settings(use_empty=True)
        addon.register()


def test_in_a_window_drawing_and_timers_end_too():
    """Blender's own calls are noted, as a Blender without a window draws nothing."""
    addon.unregister()
    drawings, kept = [], (lifecycle.has_window, host.has_window, bpy.types.SpaceView3D)

    class SpaceView3D:
        @staticmethod
        def draw_handler_add(draw, arguments, region, when):
            drawings.append(draw)
            return draw

        @staticmethod
        def draw_handler_remove(handle, region):
            drawings.remove(handle)

    class Types:
        def __getattr__(self, name):
            return SpaceView3D if name == "SpaceView3D" else getattr(types, name)

    types = bpy.types
    lifecycle.has_window = host.has_window = tool.has_window = lambda: True
    try:
        lifecycle.bpy = type("Bpy", (), {"app": bpy.app, "types": Types()})
        for _ in range(ROUNDS):
            addon.register()
            assert len(drawings) == len(lifecycle.DRAWINGS) and remains()["timers"]
            assert remains()["tools"] == ["arapfields.pin"]
            addon.unregister()
            left = remains()
            assert not drawings and not lifecycle._drawn
            assert not left["timers"] and not left["tools"] and not left["key maps"]
    finally:
        lifecycle.bpy = bpy
        lifecycle.has_window, host.has_window, _ = kept
        tool.has_window = host.has_window
        addon.register()
    assert host.has_window() is False


def test_what_failed_half_way_is_undone():
    jobs.add_message("INFO", "Bar: no folds")
    addon.unregister()
    assert not jobs.messages()
    parts, lifecycle.PARTS = lifecycle.PARTS, (*lifecycle.PARTS, (lambda: 1 / 0, None))
    try:
        with pytest.raises(ZeroDivisionError):
            addon.register()
        assert not any(remains().values())
    finally:
        lifecycle.PARTS = parts
        addon.register()
    assert hasattr(bpy.types.Object, "arapfields")


def test_what_is_said_of_a_step_goes_when_it_is_undone_and_a_job_that_ends_by_it_is_named():
    bpy.context.preferences.edit.use_global_undo = True
    scenes.bar()
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.ed.undo_push(message="after")
    jobs.add_message("INFO", "Bar: it is so")
    bpy.ops.ed.undo()
    assert not jobs.messages()
    jobs.begin(jobs.Job("Wrap", [], native.library().Task), start=False)
    jobs.add_message("WARNING", "Bar: it was so")
    bpy.ops.ed.redo()
    assert jobs.messages() == [("INFO", "Wrap cancelled")] and jobs.running() is None
    jobs.forget_messages()


# What users may do to a source or a handle, at every stage of its use: a table, each cell of it a test.
#
# Whatever is done: no error escapes, nothing of ours is left where nobody sees it, the stage ends, and the
# same object (or what is left) can be worked on again.

STAGES = ["idle", "job", "live", "bake"]
ACTIONS = [
    "deleted",
    "duplicated",
    "renamed",
    "hidden",
    "linked",
    "overridden",
    "undone",
    "redone",
    "saved",
    "reloaded",
]


@pytest.mark.parametrize("which", ["source", "handle"])
@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("action", ACTIONS)
def test_nothing_breaks(action, stage, which):
    jobs.board.messages.clear()
    with stages.watched() as errors:
        present = stages.Stage(stage)
        source, handle = present.begin()
        stages.ACTIONS[action](source if which == "source" else handle)
        said = present.end()
        stages.after(action, stage, which, said)
        stages.again()
    assert not errors, errors
    assert jobs.running() is None and not stages.stray(), stages.stray()


@pytest.mark.parametrize("target", ["MODIFIER", "NEW"])
def test_undone_past_live_and_back_leaves_nothing_astray(target):
    bar, _, moving = scenes.bar_with_handles()
    bar.arapfields.result = target
    moving.location.z += stages.LIFT
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="before")
    with stages.watched() as errors:
        bpy.ops.arapfields.live()
        bpy.ops.ed.undo_push(message="live")
        for _ in range(3):
            bpy.ops.ed.undo()
            sessions.update(bpy.context, wait=WAIT)
            assert not sessions.live and not stray() and source().visible_get()
            assert not source().modifiers and not source().arapfields.live_kind
            bpy.ops.ed.redo()
            sessions.update(bpy.context, wait=WAIT)
            shown = target == "MODIFIER" or not sessions.live  # a live object stands in for the source
            assert source().visible_get() == shown and source().hide_render == (not shown)
            assert stray() == ([] if shown else ["Bar_live"]) + [str(uid) for uid in sessions.live]
            assert bool(sessions.live) == bool(source().arapfields.live_kind)
        again()
    assert not errors, errors
    unlinked = [item.name for item in bpy.data.objects if not item.users_scene]
    assert not unlinked
