# SPDX-License-Identifier: GPL-3.0-or-later
"""Where modifiers before the field move the points off the surface at rest: live, bakes and Deform agree."""

import types

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import at, saved_animation
    from support.blender.live import step
    from support.blender.stacks import add_modifier, local_points

    import addon.solver.setup as setup
    from addon.core.geometry.spaces import space_of
    from addon.live import sessions
    from addon.surface.points_before import PointsBefore

pytestmark = pytest.mark.in_blender

AGREE = 0.02  # 1 % of the bar's length: solves of other samples and other steps
EXACT = 1e-12


def posed(path, last):
    """The bar whose right end rises, on two bones of which one is keyed; at another frame than the pins'."""
    bar, scene = saved_animation()[0], bpy.context.scene
    add_modifier(bar, "ARMATURE")
    bones = bar.modifiers["Armature"].object.pose.bones
    bone = bones["Second" if path == "rotation_euler" else "Bone"]
    bones["Second"].rotation_euler.z = 0.0
    for frame, value in ((1, (0.0, 0.0, 0.0)), (5, last)):
        setattr(bone, path, value)
        bone.keyframe_insert(path, frame=frame)
    scene.frame_set(4)
    scenes.activate(bar)
    return bar


def live_points(bar, samples):
    """What live mode shows with so many samples."""
    few, setup.SAMPLES = setup.SAMPLES, samples
    try:
        sessions.begin(bpy.context, bar)
        step(refined=True)
    finally:
        setup.SAMPLES = few
    points = local_points(bar)
    sessions.end(bpy.context, bar)
    scenes.activate(bar)
    return points


def stretch(bar, points, before):
    """(least, most) length of an edge as a share of that before."""
    ends = np.array([edge.vertices[:] for edge in bar.data.edges])
    lengths = [np.linalg.norm(p[ends[:, 0]] - p[ends[:, 1]], axis=1) for p in (points, before)]
    shares = lengths[0] / lengths[1]
    return shares.min(), shares.max()


@pytest.mark.parametrize("pose", [("rotation_euler", (0.0, 0.0, 1.0)), ("location", (0.0, 5.0, 0.0))])
def test_live_bakes_and_deform_agree_beside_an_animated_pose(pose):
    """And none tears the shape, however many samples it takes, and however far the pose leads."""
    bar = posed(*pose)
    before = local_points(bar)
    shapes = [live_points(bar, samples) for samples in (500, 3000)]
    assert bpy.ops.arapfields.deform(field="radial", samples=4000) == {"FINISHED"}
    shapes.append(local_points(bar))
    assert bpy.ops.arapfields.bake(format="PC2", start=1, end=5) == {"FINISHED"}
    shapes.append(at(bar, 4))
    for shape in shapes:
        least, most = stretch(bar, shape, before)
        assert least > 0.8 and most < 1.25
        assert np.abs(shape - shapes[-1]).max() < AGREE
    assert np.abs(shapes[0] - before).max() > 0.3  # the handle has moved it


def test_clothes_stay_beside_a_posed_body():
    """They are posed by the same armature, and carried; live, in a job and in a bake."""
    bar = posed("rotation_euler", (0.0, 0.0, 1.0))
    bpy.context.scene.frame_set(1)
    coat = bar.copy()
    coat.data, coat.name = bar.data.copy(), "Coat"
    coat.arapfields.handles.clear()
    bpy.context.collection.objects.link(coat)
    scenes.set_positions(coat.data, local_points(bar) * (1.02, 1.1, 1.1))
    scenes.activate(coat, bar)
    assert bpy.ops.arapfields.carry(way="FOLLOW") == {"FINISHED"}
    bpy.context.scene.frame_set(4)
    rest = np.linalg.norm(scenes.world_points(coat) - scenes.world_points(bar), axis=1)
    sessions.begin(bpy.context, bar)
    step(refined=True)
    gaps = [scenes.world_points(coat) - scenes.world_points(bar)]
    sessions.end(bpy.context, bar)
    scenes.activate(bar)
    assert bpy.ops.arapfields.deform(field="radial", samples=4000) == {"FINISHED"}
    gaps.append(scenes.world_points(coat) - scenes.world_points(bar))
    for gap in gaps:
        assert np.abs(np.linalg.norm(gap, axis=1) - rest).max() < 0.02


def test_points_turn_with_the_field_at_their_rest():
    rng = np.random.default_rng(3)
    rest, q = rng.normal(size=(50, 3)), np.linalg.qr(rng.normal(size=(3, 3)))[0]
    q *= np.sign(np.linalg.det(q))
    surface = types.SimpleNamespace(local=rest, vertices=rest, space=space_of(np.eye(4), "It"))
    field = types.SimpleNamespace(jacobian=lambda points: np.broadcast_to(q, (len(points), 3, 3)))
    moved = rest + np.where(np.arange(50)[:, None] < 20, rng.normal(size=(50, 3)), 0.0)
    assert np.abs(PointsBefore(surface, moved).moved(rest @ q.T, field) - moved @ q.T).max() < EXACT
    far = rest + np.array([0.0, 30.0, 0.0])
    assert np.abs(PointsBefore(surface, far).moved(rest @ q.T, field) - rest @ q.T - far + rest).max() < 1e-9
    assert PointsBefore(surface, rest.copy()).moved(moved, None) is moved
