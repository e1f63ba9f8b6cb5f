# SPDX-License-Identifier: GPL-3.0-or-later
"""Painted stiffness, symmetry, and objects that resist together with the body."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.live import step

    from addon.live import sessions

pytestmark = pytest.mark.in_blender


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
