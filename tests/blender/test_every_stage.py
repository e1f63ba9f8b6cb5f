# SPDX-License-Identifier: GPL-3.0-or-later
"""What users may do to a source or a handle, at every stage of its use: a table, each cell of it a test.

Whatever is done: no error escapes, nothing of ours is left where nobody sees it, the stage ends, and the
same object (or what is left) can be worked on again.
"""

import pytest
from inside import in_blender

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
    "reloaded",
]
ENDS_WORK = {"undone", "redone", "reloaded"}  # whatever works on the file, as before_undo and before_load say


@pytest.mark.parametrize("which", ["source", "handle"])
@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("action", ACTIONS)
@in_blender
def test_nothing_breaks(action, stage, which):
    import stages
    from test_every_stage import after, again, stray

    from addon.core.runtime import jobs

    jobs.board.messages.clear()
    with stages.watched() as errors:
        present = stages.Stage(stage)
        source, handle = present.begin()
        stages.ACTIONS[action](source if which == "source" else handle)
        said = present.end()
        after(action, stage, which, said)
        again()
    assert not errors, errors
    assert jobs.running() is None and not stray(), stray()


def source():
    """The object with the handles that is in the scene and not a copy, or None."""
    import bpy

    names = ("Other Name", "Bar")
    return next((bpy.context.scene.objects[name] for name in names if is_source(name)), None)


def is_source(name):
    import bpy

    item = bpy.context.scene.objects.get(name)
    return item is not None and item.type == "MESH" and item.override_library is None and not item.library


def after(action, stage, which, said):
    """What must have come of it."""
    import bpy
    import scenes
    from test_every_stage import ENDS_WORK, source

    from addon.live import sessions

    item, gone = source(), which == "source" and action in ("deleted", "overridden")
    if stage == "idle":
        return
    if stage == "live":
        if gone:
            assert not sessions.live and "live mode ended" in said
        elif action != "reloaded":
            assert sessions.is_live(item), said
        else:
            assert not sessions.live and not item.arapfields.live_kind
        if item is not None and sessions.is_live(item) and action not in ("deleted", "overridden"):
            assert scenes.world_points(item)[:, 2].max() > 0.4, said  # it still follows the handle
        return
    if action in ENDS_WORK:
        assert said == "ended" and "Bar_baked" not in bpy.data.objects
    elif gone:
        assert "was deleted while it was worked on" in said and "Bar_baked" not in bpy.data.objects
    elif stage == "job":
        assert item.modifiers and scenes.world_points(item)[:, 2].max() > 0.4, said
    else:
        assert any(one.name.endswith("_baked") for one in bpy.data.objects), said


def again():
    """Live mode goes off, and what is left of the source can be deformed, or says why not."""
    import bpy
    import scenes
    from test_every_stage import source

    from addon.live import sessions

    for uid in list(sessions.live):
        sessions.end(bpy.context, sessions.live[uid].source.get())
    item = source()
    if item is None:
        return
    item.hide_set(False)
    scenes.activate(item)
    assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}


def stray():
    """Names of what nobody sees: live objects, scenes and helper meshes of ours."""
    import bpy

    from addon.live import sessions

    found = [item.name for item in bpy.data.objects if item.name.endswith("_live")]
    found += [scene.name for scene in bpy.data.scenes if scene.name.startswith("ARAP")]
    used = {group.name for group in bpy.data.node_groups if group.users == 0 and "ARAP" in group.name}
    return [*found, *used, *(str(uid) for uid in sessions.live)]


@pytest.mark.parametrize("target", ["MODIFIER", "NEW"])
@in_blender
def test_undone_past_live_and_back_leaves_nothing_astray(target):
    import bpy
    import scenes
    import stages
    from test_every_stage import again, source, stray

    from addon.live import sessions

    bar, _, moving = scenes.bar_with_handles()
    bar.arapfields.target = target
    moving.location.z += stages.LIFT
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="before")
    with stages.watched() as errors:
        bpy.ops.arapfields.live()
        bpy.ops.ed.undo_push(message="live")
        for _ in range(3):
            bpy.ops.ed.undo()
            sessions.update(bpy.context, wait=stages.WAIT)
            assert not sessions.live and not stray() and source().visible_get()
            assert not source().modifiers and not source().arapfields.live_kind
            bpy.ops.ed.redo()
            sessions.update(bpy.context, wait=stages.WAIT)
            assert not stray() and source().visible_get() and not source().hide_render
        again()
    assert not errors, errors
    unlinked = [item.name for item in bpy.data.objects if not item.users_scene]
    assert not unlinked
