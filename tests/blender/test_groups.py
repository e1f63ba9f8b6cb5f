# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups of large meshes: read in slices, counted aside."""

import time

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes

    from addon.blender import vertex_groups
    from addon.core.errors import UserError
    from addon.core.runtime.coroutines import run_to_completion
    from addon.handles import held_counts

pytestmark = pytest.mark.in_blender


def test_weights_of_groups_are_read_in_slices():
    bar = scenes.decorate(scenes.bar())
    other = bar.vertex_groups.new(name="Other")
    other.add([1, 5], 0.25, "REPLACE")
    expected = np.array([sum(g.weight for g in v.groups if g.group == 0) for v in bar.data.vertices])
    vertex_groups.BLOCK, block = 50, vertex_groups.BLOCK
    try:
        coroutine = vertex_groups.read_weights(bpy.context, bar, ["Other", "Group"])
        slices = sum(1 for _ in coroutine)
        assert slices == -(-len(bar.data.vertices) // 50)
        weights = run_to_completion(vertex_groups.read_weights(bpy.context, bar, ["Other", "Group"]))
        assert np.array_equal(weights["Group"], expected) and weights["Other"].sum() == 0.5
        coroutine = vertex_groups.read_weights(bpy.context, bar, ["Group"])
        next(coroutine)
        bar.data.clear_geometry()
        try:
            run_to_completion(coroutine)
        except UserError as error:
            assert "changed while" in str(error)
        else:
            raise AssertionError("a changed mesh was read on")
    finally:
        vertex_groups.BLOCK = block
    bar = scenes.decorate(scenes.bar("Second"))
    bar.modifiers.new("Subdivision", "SUBSURF")
    bpy.context.view_layer.update()
    meshes = set(bpy.data.meshes.keys())
    weights = run_to_completion(vertex_groups.read_weights(bpy.context, bar, ["Group"]))["Group"]
    assert len(weights) == len(scenes.world_points(bar)) and 0 < weights.max() <= 1
    assert set(bpy.data.meshes.keys()) == meshes


def test_a_window_counts_large_meshes_aside():
    bar, fixed, _ = scenes.bar_with_handles()
    scenes.decorate(bar)
    entries = bar.arapfields.handles
    bpy.ops.arapfields.add_handle(kind="GROUP", group="Group", place="CURSOR")
    at_once = [entry.inside for entry in entries]
    assert min(at_once) > 0
    for entry in entries:
        entry.inside = -1
    held_counts.pending[bar.session_uid] = held_counts.counting(bpy.context, bar)
    while held_counts.poll_counts() is not None:
        time.sleep(0.005)
    assert [entry.inside for entry in entries] == at_once
    coroutine = held_counts.counting(bpy.context, bar)
    next(coroutine)
    bpy.data.objects.remove(fixed)  # between a count and its end
    held_counts.pending[bar.session_uid] = coroutine
    while held_counts.poll_counts() is not None:
        time.sleep(0.005)
