# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups of large meshes: read in slices, counted aside."""

from inside import in_blender


@in_blender
def test_weights_of_groups_are_read_in_slices():
    import bpy
    import numpy as np
    import scenes

    from addon.bridge import groups
    from addon.core.courses import finished
    from addon.core.errors import UserError

    bar = scenes.decorate(scenes.bar())
    other = bar.vertex_groups.new(name="Other")
    other.add([1, 5], 0.25, "REPLACE")
    expected = np.array([sum(g.weight for g in v.groups if g.group == 0) for v in bar.data.vertices])
    groups.BLOCK, block = 50, groups.BLOCK
    try:
        course = groups.read_weights(bpy.context, bar, ["Other", "Group"])
        slices = sum(1 for _ in course)
        assert slices == -(-len(bar.data.vertices) // 50)
        found = finished(groups.read_weights(bpy.context, bar, ["Other", "Group"]))
        assert np.array_equal(found["Group"], expected) and found["Other"].sum() == 0.5
        course = groups.read_weights(bpy.context, bar, ["Group"])
        next(course)
        bar.data.clear_geometry()
        try:
            finished(course)
        except UserError as error:
            assert "changed while" in str(error)
        else:
            raise AssertionError("a changed mesh was read on")
    finally:
        groups.BLOCK = block
    bar = scenes.decorate(scenes.bar("Second"))
    bar.modifiers.new("Subdivision", "SUBSURF")
    bpy.context.view_layer.update()
    meshes = set(bpy.data.meshes.keys())
    found = finished(groups.read_weights(bpy.context, bar, ["Group"]))["Group"]
    assert len(found) == len(scenes.world_points(bar)) and 0 < found.max() <= 1
    assert set(bpy.data.meshes.keys()) == meshes


@in_blender
def test_a_window_counts_large_meshes_aside():
    import time

    import bpy
    import scenes

    from addon.bridge import counting

    bar, fixed, _ = scenes.bar_with_handles()
    scenes.decorate(bar)
    entries = bar.arapfields.handles
    bpy.ops.arapfields.add_handle(kind="GROUP", group="Group", place="CURSOR")
    at_once = [entry.inside for entry in entries]
    assert min(at_once) > 0
    for entry in entries:
        entry.inside = -1
    counting._courses[bar.session_uid] = counting.counting(bpy.context, bar)
    while counting.tick() is not None:
        time.sleep(0.005)
    assert [entry.inside for entry in entries] == at_once
    course = counting.counting(bpy.context, bar)
    next(course)
    bpy.data.objects.remove(fixed)  # between a count and its end
    counting._courses[bar.session_uid] = course
    while counting.tick() is not None:
        time.sleep(0.005)
