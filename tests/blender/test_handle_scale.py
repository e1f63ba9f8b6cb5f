# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles that scale what they hold, where that is asked for."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import RUN, cache_file
    from support.blender.live import step
    from support.blender.panels import drawn
    from support.blender.stacks import local_points

    from addon.core.runtime import jobs

pytestmark = pytest.mark.in_blender


def enlarged(allow):
    """(bar, moving): the bar's end is half as large again, by its handle; held at the other."""
    bar, _, moving = scenes.bar_with_handles()
    bar.arapfields.handles[1].allow_scale = allow
    moving.scale = [1.5 * s for s in moving.scale]
    bpy.context.view_layer.update()
    scenes.activate(bar)
    return bar, moving


@pytest.mark.parametrize("allow", [False, True])
def test_what_a_handle_holds_is_scaled_where_asked(allow):
    bar, moving = enlarged(allow)
    rest = np.array([v.co for v in bar.data.vertices])
    held = rest[:, 0] > 0.8
    expected = rest[held] + ([0.5, 0.5, 0.5] * (rest[held] - [1, 0, 0]) if allow else 0.0)
    bpy.ops.arapfields.deform(**RUN)
    shapes = [local_points(bar)]
    bpy.ops.arapfields.live()
    step(refined=True)
    shapes.append(local_points(bar))
    bpy.ops.arapfields.live()
    moving.keyframe_insert("scale", frame=1)
    bpy.ops.arapfields.bake(start=1, end=1, filepath=cache_file())
    shapes.append(local_points(bar))
    for after in shapes:
        error = np.abs(after[held] - expected).max()
        print(allow, error)
        assert error < (0.03 if allow else 0.01)  # handles are followed nearly
        assert np.abs(after[rest[:, 0] < -0.8] - rest[rest[:, 0] < -0.8]).max() < 0.03


def test_a_flat_or_mirrored_scale_is_refused_by_name_and_by_axis_it_may_differ():
    bar, moving = enlarged(True)
    kept = moving.scale[2]
    for bad in (0.0, -kept):
        moving.scale[2] = bad
        bpy.context.view_layer.update()
        with pytest.raises(RuntimeError, match="Moving: its scale flattens or mirrors"):
            bpy.ops.arapfields.deform(**RUN)
    moving.scale = (0.25, 0.5, 1.0)
    bpy.context.view_layer.update()
    scenes.activate(bar)
    bpy.ops.arapfields.deform(**RUN)
    tip = np.array([v.co.x for v in bar.data.vertices]) > 0.9
    after = local_points(bar)[tip]
    assert abs(np.ptp(after[:, 2]) - 1.0) < 0.1 and abs(np.ptp(after[:, 1]) - 0.5) < 0.1
    bpy.ops.arapfields.mirror_handle(axis="X")
    assert all(entry.allow_scale for entry in bar.arapfields.handles[1:])


def test_a_scale_that_counts_for_nothing_is_said():
    said = "Moving is scaled, which counts only with Allow Scale"

    def warnings():
        return said in " ".join(drawn()["ARAPFIELDS_PT_handles"])

    bar, moving = enlarged(False)
    assert warnings()
    assert bpy.ops.arapfields.deform(**RUN) == {"FINISHED"}
    assert any(level == "WARNING" and said in text for level, text in jobs.messages())
    bar.arapfields.handles[1].allow_scale = True
    assert not warnings()
    bar.arapfields.handles[1].allow_scale = False
    moving.scale = [s / 1.5 for s in moving.scale]
    moving.rotation_euler = (0.3, 0.2, 0.1)
    bpy.context.view_layer.update()
    assert not warnings()
