# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that a source's field moves as well."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.bones import rigged_bar
    from support.blender.live import step
    from support.blender.riders import body, rider, shown, taken

    import arapfields as af
    from addon.blender import mesh_arrays
    from addon.live import sessions

pytestmark = pytest.mark.in_blender

CLOSE = 1e-5  # single precision of positions of size one


KINDS = ["MESH", "CURVES", "GREASEPENCIL", "CURVE", "LATTICE", "EMPTY", "ARMATURE"]


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_follows_live_and_comes_back(kind):
    bar, moving = body()
    item = rider(kind)
    bpy.context.view_layer.update()
    before = shown(item)
    scenes.activate(item, bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    counts = len(item.modifiers), len(bpy.data.node_groups)
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    assert np.abs(shown(item) - before).max() < 0.01
    moving.location.z += 0.4
    moving.rotation_euler.x = 0.3
    step(refined=True)
    session = sessions.live[bar.session_uid]
    assert not session.carrying.warnings
    after = taken(session, before)  # the bar's own coordinates are the world's
    spread = 0.05 if kind in ("EMPTY", "ARMATURE") else CLOSE
    assert np.abs(shown(item) - after).max() < spread and np.abs(after - before).max() > 0.3
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert np.abs(shown(item) - before).max() < CLOSE
    assert (len(item.modifiers), len(bpy.data.node_groups)) == counts
    if kind in ("CURVE", "LATTICE"):
        assert item.data.shape_keys is None


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_goes_with_a_solve_and_is_released(kind):
    bar, moving = body()
    item = rider(kind)
    bpy.context.view_layer.update()
    before = shown(item)
    scenes.activate(item, bar)
    bpy.ops.arapfields.carry()
    moving.location.z += 0.4
    scenes.activate(bar)
    for _ in range(2):  # a second one starts from rest again
        assert bpy.ops.arapfields.deform(field="radial", samples=1000) == {"FINISHED"}
    assert np.abs(shown(item) - before - [0, 0, 0.4]).max() < 0.1
    bpy.ops.arapfields.release()
    assert np.abs(shown(item) - before).max() < CLOSE
    assert not bar.arapfields.carried and item.arapfields.carried_by is None


def test_what_is_rigid_stays_so():
    bar, moving = body()
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1, location=(0.7, 0, 0.2), segments=12, ring_count=8)
    eye = bpy.context.object
    eye.parent = bar
    eye.location.x += 0.05
    bpy.context.view_layer.update()
    before = scenes.world_points(eye)
    scenes.activate(eye, bar)
    bpy.ops.arapfields.carry(way="RIGID")
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    moving.rotation_euler.y = -0.5
    step(refined=True)
    after = scenes.world_points(eye)
    one, other = (points - points.mean(axis=0) for points in (before, after))
    assert np.abs(np.linalg.norm(one, axis=1) - np.linalg.norm(other, axis=1)).max() < CLOSE
    assert np.linalg.norm(after.mean(axis=0) - before.mean(axis=0)) > 0.2
    assert np.abs(other - one).max() > 0.01  # it turns as well
    assert not eye.modifiers and np.allclose(eye.location[0], 0.75)
    scenes.activate(bar)
    bpy.ops.arapfields.live()
    assert np.abs(scenes.world_points(eye) - before).max() < CLOSE and not any(eye.delta_location)


def test_an_eye_on_a_bone_does_not_move_twice():
    """A child of a bone that is a handle: it is where the field has it, not the bone's motion on top."""
    bar, rig = rigged_bar()
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1, location=(0.8, 0, 0.2), segments=12, ring_count=8)
    eye = bpy.context.object
    before = scenes.world_points(eye)
    rig.data.bones.active = rig.data.bones["Second"]
    scenes.activate(eye, rig)
    bpy.ops.object.parent_set(type="BONE", keep_transform=True)
    bpy.context.view_layer.update()
    assert np.abs(scenes.world_points(eye) - before).max() < CLOSE
    scenes.activate(rig, bar)
    bpy.ops.arapfields.add_bones()
    rig.pose.bones["Second"].rotation_euler.z = 0.7  # posed before it is carried
    bpy.context.view_layer.update()
    scenes.activate(eye, bar)
    for way in ("RIGID", "FOLLOW"):
        assert bpy.ops.arapfields.carry(way=way) == {"FINISHED"}
        bpy.ops.arapfields.live()
        for angle in (0.7, -0.5):
            rig.pose.bones["Second"].rotation_euler.z = angle
            step(refined=True)
            step(refined=True)
            after = taken(sessions.live[bar.session_uid], before)
            assert np.abs(scenes.world_points(eye) - after).max() < 0.02
        bpy.ops.arapfields.live()


def test_a_sleeve_that_a_shrinkwrap_lays_on_the_body_does_not_move_twice():
    """The field moves it first, then it is laid on the body that has moved."""
    bar, _, moving = scenes.bar_with_handles()
    sleeve = scenes.bar("Sleeve", 0.6)
    for point in sleeve.data.vertices:
        point.co.y, point.co.z = 1.3 * point.co.y, 1.3 * point.co.z
    laid = sleeve.modifiers.new("Laid", "SHRINKWRAP")
    laid.target, laid.wrap_mode, laid.offset = bar, "OUTSIDE", 0.05
    bpy.context.view_layer.update()

    def away():
        bpy.context.view_layer.update()
        body = af.MeshSdf(scenes.world_points(bar), mesh_arrays.triangles(bar.data))
        return body(scenes.world_points(sleeve))

    before = away()
    scenes.activate(sleeve, bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    moving.location.z += 0.4
    bpy.context.view_layer.update()
    assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
    assert [one.type for one in sleeve.modifiers] == ["NODES", "SHRINKWRAP"]
    assert np.abs(away() - before).max() < 0.02
    bpy.ops.arapfields.release(all=True)
    assert [one.type for one in sleeve.modifiers] == ["SHRINKWRAP"]
