# SPDX-License-Identifier: GPL-3.0-or-later
"""Live styles, and the implicit surface that follows its handles."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scenes
    from support.blender.live import step
    from support.blender.scenes import FIT

    from addon.core.runtime import jobs
    from addon.live import sessions
    from addon.solver import setup

pytestmark = pytest.mark.in_blender

FEW = 600  # samples, of a ball
SINGLE = 1e-6  # single precision, of a ball of radius 1


def test_a_style_follows_its_sliders_without_handles():
    setup.SAMPLES = FEW
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    ball = bpy.context.object
    assert bpy.ops.arapfields.live(kind="STYLIZE") == {"FINISHED"}

    def corners():
        points = scenes.world_points(ball)
        points = points - points.mean(axis=0)
        return np.linalg.norm(points, axis=1).max() / np.abs(points).max()

    step(refined=True)
    cube = corners()
    assert cube > 1.25
    ball.arapfields.stylize.strength = 0.0
    step(refined=True)
    assert abs(corners() - 1) < 0.05
    ball.arapfields.stylize.strength, ball.arapfields.stylize.style = 1.0, "OCTAHEDRON"
    step(refined=True)
    assert corners() < cube - 0.1


def test_handles_and_a_style_together():
    bar, _, moving = scenes.bar_with_handles()
    before = scenes.world_points(bar)
    bar.arapfields.stylize.style, bar.arapfields.stylize.use_handles = "CYLINDER", True
    bpy.ops.arapfields.live(kind="STYLIZE")
    moving.location.z += 0.3
    step()
    shift = scenes.world_points(bar) - before
    assert np.abs(shift[before[:, 0] > 0.9].mean(axis=0) - [0, 0, 0.3]).max() < 0.12


def test_the_implicit_surface_follows_too():
    bar, _, moving = scenes.bar_with_handles()
    for name, value in FIT.items():
        setattr(bar.arapfields.fit, name, value)
    bar.arapfields.output, bar.arapfields.resolution = "SURFACE", 40
    bpy.ops.arapfields.live()
    result = bpy.data.objects["Bar_live"]
    before = scenes.world_points(result)
    assert len(before) != len(bar.data.vertices) and len(result.data.polygons) > 500
    moving.location.z += 0.3
    step()
    shift = scenes.world_points(result) - before
    assert abs(shift[before[:, 0] > 0.9][:, 2].mean() - 0.3) < 0.05


def test_a_live_style_follows_stiffness_rigidity_and_the_fold_barrier():
    setup.SAMPLES = FEW
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    ball = bpy.context.object
    style = ball.arapfields.stylize
    style.keep_stance = 0.0  # it holds a ball so well that the barrier has nothing to do
    bpy.ops.arapfields.live(kind="STYLIZE")

    def report():
        for _ in range(2):  # the first look sets the solver up anew
            step(refined=True)
        return sessions.live[ball.session_uid].solver.report

    usual = report()
    style.rigidity = 50.0
    assert report()["stretch"] < 0.2 * usual["stretch"]
    style.rigidity, style.bending = 1.0, 500.0
    assert report()["bend"] < 0.1 * usual["bend"]
    style.bending, style.barrier = 0.1, 10.0
    report()
    with_barrier = scenes.world_points(ball)
    style.barrier = 0.0
    report()
    assert np.abs(scenes.world_points(ball) - with_barrier).max() > 1e-3


def test_live_waits_while_the_object_of_a_style_is_still_to_be_chosen():
    """What was shown stays until it is, and then follows it."""
    setup.SAMPLES = FEW
    bpy.ops.mesh.primitive_cube_add(size=1, location=(5, 0, 0), rotation=(0.5, 0.3, 0))
    cube = bpy.context.object
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    ball = bpy.context.object
    bpy.ops.arapfields.live(kind="STYLIZE")
    step(refined=True)
    shown, style = scenes.world_points(ball), ball.arapfields.stylize
    for choose in (
        lambda: setattr(style, "style", "OBJECT"),
        lambda: setattr(style, "style_object", None),
        lambda: setattr(style, "strength", 0.5),
    ):
        choose()
        step(refined=True)
        assert sessions.is_live(ball, "STYLIZE") and not jobs.messages()
        assert np.array_equal(scenes.world_points(ball), shown)
    style.strength, style.style_object = 1.0, cube
    step(refined=True)
    assert sessions.is_live(ball) and np.abs(scenes.world_points(ball) - shown).max() > 0.05
    bpy.ops.arapfields.live(kind="STYLIZE")
    style.style, style.frame, style.frame_object = "CUBE", "EMPTY", None
    with pytest.raises(RuntimeError, match="Choose the object"):  # there is nothing to go on from
        bpy.ops.arapfields.live(kind="STYLIZE")
    assert not sessions.is_live(ball)


@pytest.mark.parametrize("further", [{}, {"finish": False}, {"strength": 0.5, "style": "OCTAHEDRON"}])
def test_live_rests_at_what_stylize_makes(further):
    """The same solve with the same samples: no vertex differs."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    ball = bpy.context.object
    ball.data.transform(Matrix.Diagonal((1.0, 0.7, 1.2, 1.0)))
    style = ball.arapfields.stylize
    style.samples = FEW
    for name, value in further.items():
        setattr(style, name, value)
    rest = scenes.world_points(ball)
    bpy.ops.arapfields.live(kind="STYLIZE")
    step(refined=True)
    live = scenes.world_points(ball)
    assert np.abs(live - rest).max() > 0.05
    assert bpy.ops.arapfields.stylize(result="MODIFIER") == {"FINISHED"}
    assert not sessions.is_live(ball)
    assert np.abs(scenes.world_points(ball) - live).max() < SINGLE
