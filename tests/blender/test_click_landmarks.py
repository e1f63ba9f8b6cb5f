# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks by click, driven by stand-ins for a 3D view and its mouse: a pixel is a hundredth of a unit."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scenes

    from addon.blender import modifier_stack
    from addon.blender.object_references import ObjectReference
    from addon.results import visibility
    from addon.wrap import landmarks
    from addon.wrap.clicking import ARAPFIELDS_OT_click_landmarks as Operator

pytestmark = pytest.mark.in_blender


def clicker():
    """(item, click) of a bar and a target 3 units to its right, seen from the front.

    `click(x, z)`, in units, gives what the modal operator answers and the halves of a pair that it has.
    """
    target = scenes.bar("Scan")
    target.location.x = 3
    item = scenes.bar()
    item.arapfields.wrap.onto = target
    bpy.context.view_layer.update()
    names = ("modal", "click", "struck", "take_back", "miss", "tell", "end")
    operator = type("Clicker", (), {name: vars(Operator)[name] for name in names})()
    said = []
    operator.ends, operator.clicked = [ObjectReference(item), ObjectReference(target)], {}
    operator.report = lambda *given: said.append(given)
    turn = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, -10), (0, 0, 0, 1)))
    flat = Matrix.Diagonal((0.2, 0.2, -0.01, 1)) @ turn
    view = SimpleNamespace(
        view_matrix=turn, perspective_matrix=flat, is_perspective=False, view_perspective="ORTHO"
    )
    whole = SimpleNamespace(type="WINDOW", x=0, y=0, width=1000, height=1000)
    sidebar = SimpleNamespace(type="UI", x=850, y=0, width=150, height=1000)
    space = SimpleNamespace(region_3d=view, show_gizmo=True, show_gizmo_navigate=True)
    area = SimpleNamespace(
        regions=[whole, sidebar],
        spaces=SimpleNamespace(active=space),
        header_text_set=lambda *given: said.append(given),
        tag_redraw=print,
    )
    context = SimpleNamespace(
        area=area,
        scene=bpy.context.scene,
        evaluated_depsgraph_get=bpy.context.evaluated_depsgraph_get,
        collection=bpy.context.collection,
        view_layer=bpy.context.view_layer,
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
    )

    def click(x, z):
        event = SimpleNamespace(type="LEFTMOUSE", value="PRESS", mouse_x=500 + 100 * x, mouse_y=500 + 100 * z)
        return operator.modal(context, event), sorted(operator.clicked)

    click.said = said
    return item, click


def test_a_click_just_beside_the_surface_takes_its_edge():
    item, click = clicker()
    assert click(-1.08, 0.0) == ({"RUNNING_MODAL"}, [0])
    assert click(3.0, 0.33) == ({"RUNNING_MODAL"}, [])
    (pair,) = item.arapfields.wrap.landmarks
    ends = [end.matrix_world.translation for end in (pair.rest, pair.on_target)]
    assert np.abs(ends[0].x + 1) < 0.05 and np.abs(ends[1].z - 0.25) < 0.05


def test_a_click_on_neither_selects_nothing_and_the_sidebar_has_its_own():
    _, click = clicker()
    assert click(1.5, 0.0) == ({"RUNNING_MODAL"}, [])  # between the two
    assert click(3.8, 0.0) == ({"PASS_THROUGH"}, [])  # the sidebar lies over the target
    assert click(3.0, 4.0) == ({"PASS_THROUGH"}, [])  # the gizmos of navigation


def test_a_click_that_misses_gives_a_sign():
    _, click = clicker()
    said = click.said
    click(1.5, 0.0)
    assert said.pop(0) == ({"WARNING"}, "Neither Bar nor Scan lies there")
    assert said.pop(0)[0].startswith("Neither Bar nor Scan lies there. Click a place on Bar")
    click(0.0, 0.0)
    assert said == [("Click the same place on Scan. Backspace takes back, Enter ends",)]


def test_landmarks_lie_on_the_shape_that_is_shown():
    item, click = clicker()
    for x in (-0.9, 0.9):
        scenes.activate(scenes.cube_empty((x, 0, 0), (0.15, 0.4, 0.4)), item)
        bpy.context.view_layer.update()
        bpy.ops.arapfields.add_handle()
    item.arapfields.handles[1].empty.location.z += 0.5
    bpy.context.view_layer.update()
    bpy.ops.arapfields.deform(**scenes.QUICK)
    click(0.9, 0.5)
    click(3.0, 0.0)
    (pair,) = item.arapfields.wrap.landmarks
    rest = np.array(pair.rest.matrix_world.translation)
    shown = landmarks.shown_place(item, rest)
    assert abs(rest[2]) < 0.15 and np.linalg.norm(shown - (0.9, -0.25, 0.5)) < 0.1
    modifier_stack.find(item).show_viewport = False
    assert (landmarks.shown_place(item, rest) == rest).all()


def test_landmarks_go_when_it_is_wrapped_and_come_again():
    item, _ = clicker()
    item.arapfields.wrap.samples, item.arapfields.wrap.stages = 1000, 1
    bpy.ops.arapfields.add_landmark(rest=(-1, 0, 0), on_target=(2, 0, 0))
    (pair,) = item.arapfields.wrap.landmarks
    ends = pair.rest, pair.on_target
    for again in (
        lambda: visibility.show_landmarks(item, True),
        lambda: bpy.ops.arapfields.remove_result(kind="WRAP"),
    ):
        assert all(end.visible_get() for end in ends)
        bpy.ops.arapfields.wrap()
        assert not any(end.visible_get() for end in ends)
        again()
    assert all(end.visible_get() for end in ends)


def test_landmarks_are_mirrored_once():
    source, target = scenes.bar(), scenes.bar()
    target.location.x = 4.0
    scenes.activate(source)
    source.arapfields.wrap.onto = target
    bpy.context.view_layer.update()
    for x in (0.0, 0.8):
        bpy.ops.arapfields.add_landmark(rest=(x, 0, 0.25), on_target=(4 + x, 0, 0.25))
    pairs = source.arapfields.wrap.landmarks
    for _ in range(2):
        assert bpy.ops.arapfields.mirror_landmarks() == {"FINISHED"} and len(pairs) == 3
    ends = [round(end.matrix_world.translation.x, 3) for end in (pairs[2].rest, pairs[2].on_target)]
    assert ends == [-0.8, 3.2] and len({tuple(pair.colour) for pair in pairs}) == 3
