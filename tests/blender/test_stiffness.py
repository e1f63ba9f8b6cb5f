# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups: painted stiffness, the influence mask, how weights are read."""

import time

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import RUN, cache_file
    from support.blender.live import step
    from support.blender.stacks import local_points

    from addon.blender import modifier_stack, vertex_groups
    from addon.core.errors import UserError
    from addon.core.runtime.jobs import run_to_completion
    from addon.field_modifier import node_group
    from addon.handles import held_counts
    from addon.live import sessions

pytestmark = pytest.mark.in_blender

# Painted stiffness, symmetry, and objects that resist together with the body.


def painted_bar(times=1.0):
    """(bar, moving): the bar's right half is so many times as stiff; its end is pulled and turned."""
    bar, _, moving = scenes.bar_with_handles()
    group = bar.vertex_groups.new(name="Bone")
    x = np.array([vertex.co.x for vertex in bar.data.vertices])
    group.add(np.flatnonzero(x > 0.1).tolist(), 1.0, "REPLACE")
    ours = bar.arapfields.stiffness
    ours.group, ours.times = "Bone", times
    moving.location.z, moving.location.x, moving.rotation_euler.y = 0.3, 1.3, -0.4
    bpy.context.view_layer.update()
    scenes.activate(bar)
    return bar, moving


def stretch(bar, before, low, high):
    """Largest change of an edge's length, of its own, among those with low < x < high at rest."""
    edges = np.array([edge.vertices for edge in bar.data.edges])
    x = before[edges][..., 0]
    kept = edges[(x > low).all(axis=1) & (x < high).all(axis=1)]
    after = scenes.world_points(bar)
    lengths = [np.linalg.norm(p[kept[:, 0]] - p[kept[:, 1]], axis=1) for p in (before, after)]
    return np.abs(lengths[1] / lengths[0] - 1).max()


def test_a_stiff_part_does_not_stretch_and_ones_change_nothing():
    bar, _ = painted_bar()
    before = scenes.world_points(bar) * 0 + np.array([vertex.co for vertex in bar.data.vertices])
    run = {"field": "radial", "samples": 1500}
    bpy.ops.arapfields.deform(**run)
    soft, plain = stretch(bar, before, 0.3, 0.7), scenes.world_points(bar)
    bar.arapfields.stiffness.group = ""
    bpy.ops.arapfields.deform(**run)
    assert np.array_equal(scenes.world_points(bar), plain)
    bar.arapfields.stiffness.group, bar.arapfields.stiffness.times = "Bone", 1000.0
    bpy.ops.arapfields.deform(**run)
    stiff = stretch(bar, before, 0.3, 0.7)
    print(f"stretch {soft:.3g}, a thousand times as stiff {stiff:.3g}")
    assert soft > 0.01 and stiff < 1e-3


def test_live_follows_the_brush_and_presets():
    bar, _ = painted_bar()
    before = np.array([vertex.co for vertex in bar.data.vertices])
    bpy.ops.arapfields.live()
    step(refined=True)
    stretches = [stretch(bar, before, 0.2, 0.7)]
    assert bpy.ops.arapfields.stiffness_preset(material="WOOD") == {"FINISHED"}
    for _ in range(2):
        step(refined=True)
    stretches.append(stretch(bar, before, 0.2, 0.7))
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
    bar.vertex_groups["Bone"].add(range(len(bar.data.vertices)), 0.01, "REPLACE")
    bar.data.update()
    bpy.context.view_layer.update()
    __import__("time").sleep(0.4)
    for _ in range(3):
        step(refined=True)
    stretches.append(stretch(bar, before, 0.2, 0.7))
    print(stretches)
    assert stretches[1] < 0.1 * stretches[0] and stretches[2] > 0.5 * stretches[0]
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.arapfields.live()
    bar.vertex_groups.remove(bar.vertex_groups["Bone"])
    with pytest.raises(RuntimeError, match="Bar has no vertex group Bone"):
        bpy.ops.arapfields.deform()


def test_symmetry_moves_both_sides_alike_also_live():
    bar, fixed, moving = scenes.bar_with_handles()
    scenes.activate(fixed, bar)
    bpy.ops.arapfields.remove_handle()
    middle = scenes.cube_empty((0, 0, 0), (0.1, 0.5, 0.5), "Middle")
    bpy.context.view_layer.update()
    scenes.activate(middle, bar)
    bpy.ops.arapfields.add_handle()
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    moving.location.z += 0.3
    step(refined=True)
    rest = np.random.default_rng(0).uniform((-1, -0.3, -0.3), (1, 0.3, 0.3), (200, 3))

    def unlike():
        field = sessions.live[bar.session_uid].solver.field
        return np.abs(field(rest * [-1, 1, 1]) - field(rest) * [-1, 1, 1]).max()

    assert unlike() > 0.1
    bar.arapfields.deform.symmetry = "x"
    step(refined=True)
    assert unlike() < 1e-6


def test_what_goes_together_resists_and_is_held():
    """A rod on the bar is bent less than one that follows: it is sampled too."""
    bar, _, moving = scenes.bar_with_handles()
    rod = scenes.bar("Rod", length=0.5)
    rod.location.z, rod.scale = 0.4, (1.0, 0.4, 0.4)
    bpy.context.view_layer.update()
    scenes.activate(rod, bar)
    shapes = []
    for way in ("FOLLOW", "TOGETHER"):
        assert bpy.ops.arapfields.carry(way=way) == {"FINISHED"}
        scenes.activate(rod, bar)
        bpy.ops.arapfields.live()
        session = sessions.live[bar.session_uid]
        assert bool(session.reader.surface.solids) == (way == "TOGETHER") and not session.carrying.warnings
        moving.location.z, moving.rotation_euler.y = 0.5, -0.6
        step(refined=True)
        shapes.append(scenes.world_points(rod))
        on_rod = session.solver.samples.mesh_indices == 1 if way == "TOGETHER" else np.zeros(1)
        assert (on_rod.mean() > 0.05) == (way == "TOGETHER")
        bpy.ops.arapfields.live()
        moving.location.z, moving.rotation_euler.y = 0.0, 0.0
        bpy.context.view_layer.update()
    assert np.abs(shapes[0] - shapes[1]).max() > 0.005


# The influence mask: a vertex group of the source that every result of the field heeds.


def masked_bar():
    """(bar, moving, rest, masked out): the mask is 1 right of 0, else 0; the right end is pulled up."""
    bar, _, moving = scenes.bar_with_handles()
    rest = local_points(bar)
    bar.vertex_groups.new(name="Face").add(np.flatnonzero(rest[:, 0] > 0.01).tolist(), 1.0, "REPLACE")
    moving.location.z += 0.4
    bpy.context.view_layer.update()
    scenes.activate(bar)
    return bar, moving, rest, rest[:, 0] < 0.01


def test_where_it_is_zero_points_stay_bit_for_bit_whatever_is_solved():
    bar, _, rest, out = masked_bar()
    settings = bar.arapfields.stiffness
    settings.mask = "Face"  # before there is a modifier
    bpy.ops.arapfields.deform(**RUN)
    assert np.array_equal(local_points(bar)[out], rest[out]) and np.abs(local_points(bar) - rest).max() > 0.2
    settings.mask = ""
    assert np.abs(local_points(bar)[out] - rest[out]).max() > 0.01
    settings.mask = "Face"
    assert np.array_equal(local_points(bar)[out], rest[out])
    bar.modifiers.remove(modifier_stack.find(bar))
    bpy.ops.arapfields.live()
    step()
    assert np.array_equal(local_points(bar)[out], rest[out]) and np.abs(local_points(bar) - rest).max() > 0.2
    bpy.ops.arapfields.live()
    bpy.ops.arapfields.bake(start=1, end=2, filepath=cache_file())
    assert modifier_stack.find_cache(bar).vertex_group == "Face"
    assert np.array_equal(local_points(bar)[out], rest[out]) and np.abs(local_points(bar) - rest).max() > 0.2
    settings.mask = ""
    assert modifier_stack.find_cache(bar).vertex_group == ""
    bpy.ops.arapfields.deform(**RUN)
    node_group.put_attribute(modifier_stack.find(bar), "Mask", "Face")  # the user's own, at the modifier
    bpy.ops.arapfields.deform(**RUN)
    assert node_group.get_attribute(modifier_stack.find(bar), "Mask") == "Face"


def test_a_mask_that_is_gone_is_named():
    bar, _, rest, _ = masked_bar()
    bar.arapfields.stiffness.mask = "Face"
    bar.vertex_groups.remove(bar.vertex_groups["Face"])
    for call in (lambda: bpy.ops.arapfields.deform(**RUN), bpy.ops.arapfields.live):
        with pytest.raises(RuntimeError, match="Bar has no vertex group Face"):
            call()
    assert np.array_equal(local_points(bar), rest) and len(bar.arapfields.handles) == 2


# Vertex groups of large meshes: read in slices, counted aside.


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
