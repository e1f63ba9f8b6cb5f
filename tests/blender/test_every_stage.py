# SPDX-License-Identifier: GPL-3.0-or-later
"""What users may do to a source or a handle, at every stage of its use: a table, each cell of it a test.

Whatever is done: no error escapes, nothing of ours is left where nobody sees it, the stage ends, and the
same object (or what is left) can be worked on again.
"""

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes, stages
    from support.blender.live import WAIT
    from support.blender.stages import again, source, stray

    from addon.core.runtime import jobs
    from addon.live import sessions

pytestmark = pytest.mark.in_blender

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
