# SPDX-License-Identifier: GPL-3.0-or-later
"""Wrap by mouse: target, landmarks, Wrap, Esc, Factor, undo, reopening of the file, a sequence of scans."""

import shutil
import time
import types

import bpy
import numpy as np
import panel
import stage
from mathutils import Vector
from mouse import click, keys, pixel, until_idle
from support.blender import character, scenes, wraps

from addon.blender import modifier_stack
from addon.core.runtime import jobs

SCAN_AT = Vector((2.0, 0, 0))
# Positions in the sidebar of a window of 1600 × 1000, with only Wrap open.
EYEDROPPER, BUTTON, WRAP = (1263, 229), (1155, 275), (1155, 506)
TRANSFER = (1165, 711)
SEQUENCE = (1155, 814)  # for a wrapped object with fitted bones
SETTLED = 1.5  # seconds until the sidebar's sections have stopped moving


def checks(figures, folder):
    yield from set_stage()
    yield from choose_target(figures, folder)
    yield from click_landmarks(figures, folder)
    yield from press(figures, folder)


def set_stage():
    """Shows the rigged, textured body and the scan beside it from the front, with only Wrap open."""
    stage.empty_file()
    with stage.override():
        body, rig = wraps.rigged_character()
        scan, _ = wraps.scan_of(wraps.grown_parts())
        scan.location = SCAN_AT
        body.data.materials.append(chequered())
        rig.show_in_front = True
        scenes.activate(body)
        bpy.ops.view3d.view_all()
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.context.space_data.shading.color_type = "TEXTURE"
        bpy.ops.ed.undo_push(message="stage")
    yield 2.0
    yield from panel.open_alone({"wrap"})
    yield SETTLED


def chequered():
    picture = bpy.data.images.new("Chequers", 512, 512)
    picture.generated_type = "COLOR_GRID"
    material = bpy.data.materials.new("Chequered")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = picture
    shader = material.node_tree.nodes["Principled BSDF"]
    material.node_tree.links.new(node.outputs[0], shader.inputs[0])
    material.node_tree.nodes.active = node
    return material


def choose_target(figures, folder):
    """Chooses the scan by the eyedropper beside Onto."""
    body, scan = bpy.data.objects["Body"], bpy.data.objects["Scan"]
    yield from click(EYEDROPPER)
    yield from click(pixel(SCAN_AT + Vector((0, -0.2, 1.2))))
    figures["wrap_target_by_eyedropper"] = body.arapfields.wrap.onto == scan


def click_landmarks(figures, folder):
    """Clicks five pairs; the first half and the first pair are removed by Backspace and clicked again."""
    entries = bpy.data.objects["Body"].arapfields.wrap.landmarks
    pairs = [(Vector(rest), SCAN_AT + Vector(goal)) for rest, goal in wraps.landmarks_of_people()]
    middle = [Vector((0, 0, 1.0)), SCAN_AT + Vector((0, 0, 1.2))]
    yield from click(BUTTON)
    yield from click(inward(pairs[0][0], middle[0]))
    stage.picture(folder, "wrap-half-a-pair")
    yield from keys("BackSpace")
    for number, pair in enumerate((pairs[0], *pairs)):
        for end, inner in zip(pair, middle, strict=True):
            yield from click(inward(end, inner))
        if number == 0:
            figures["wrap_first_pair"] = len(entries)
            yield from keys("BackSpace")
            figures["wrap_taken_back"] = len(entries)
    stage.picture(folder, "wrap-clicked")
    yield from keys("Return")
    away = [
        round(float((Vector(end.matrix_world.translation) - where).length), 3)
        for entry, pair in zip(entries, pairs, strict=True)
        for end, where in zip((entry.rest, entry.on_target), pair, strict=True)
    ]
    figures["wrap_landmarks_off_by"] = away
    stage.tool("mousemove", 500, 850)
    yield 0.6
    stage.picture(folder, "wrap-landmarks")


def inward(end, middle, by=0.03):
    """The pixel of a point just inside the outline."""
    return pixel(end + by * (middle - end).normalized())


def shape():
    return scenes.world_points(bpy.data.objects["Body"])


def press(figures, folder):
    """Presses Esc in the first wrap; a complete one is undone, redone and posed, then loses its target."""
    body, rig = bpy.data.objects["Body"], bpy.data.objects["Rig"]
    rest, bones = shape(), wraps.joints(rig, posed=False)
    yield from click(WRAP, pause=1.0)
    was_running = jobs.running() is not None
    stage.tool("mousemove", 600, 500)
    yield from keys("Escape", pause=0.1)
    yield from until_idle(20.0)
    yield 0.5
    figures["wrap_escape"] = was_running and np.array_equal(shape(), rest) and not fielded(body)
    begin = time.perf_counter()
    yield from click(WRAP, pause=1.0)
    stage.picture(folder, "wrap-running")
    yield from until_idle(400.0)
    figures["wrap_press_s"] = round(time.perf_counter() - begin, 1)
    yield 1.0
    stage.tool("mousemove", 500, 850)
    yield 0.6
    stage.picture(folder, "wrap-wrapped")
    wrapped, moved = shape(), wraps.joints(rig, posed=False)
    figures["wrap_moves"] = [
        round(float(np.abs(a - b).max()), 3) for a, b in ((wrapped, rest), (moved, bones))
    ]
    yield from keys("ctrl+z", pause=1.5)
    body, rig = bpy.data.objects["Body"], bpy.data.objects["Rig"]
    figures["wrap_undone"] = np.array_equal(shape(), rest) and not fielded(body)
    figures["wrap_undone_bones"] = np.allclose(wraps.joints(rig, posed=False), bones, atol=1e-6)
    yield from keys("ctrl+shift+z", pause=1.5)
    body, rig = bpy.data.objects["Body"], bpy.data.objects["Rig"]
    figures["wrap_redone"] = np.array_equal(shape(), wrapped)
    figures["wrap_redone_bones"] = np.allclose(wraps.joints(rig, posed=False), moved, atol=1e-6)
    figures["wrap_stack"] = [m.type for m in body.modifiers]
    with stage.override():
        character.pose(types.SimpleNamespace(rig=rig))
    yield 1.0
    stage.picture(folder, "wrap-posed")
    yield from hand_on(figures, folder)
    yield from target_gone(figures, folder)


def hand_on(figures, folder):
    """Transfer to Target with undo and redo: the scan has the body's groups and a separate armature."""

    def given():
        scan = bpy.data.objects["Scan"]
        return len(scan.vertex_groups), [m.type for m in scan.modifiers]

    bpy.data.objects["Body"].arapfields.wrap.transfer -= {"KEYS"}  # refused: Mirror changes the vertices
    before = given()
    yield from click(TRANSFER, pause=0.5)
    yield from until_idle(60.0)
    yield 1.0
    stage.picture(folder, "wrap-transferred")
    after = given()
    figures["wrap_transferred"] = after[0] > 0 and after[1] == ["ARMATURE"] and before == (0, [])
    yield from keys("ctrl+z", pause=1.5)
    figures["wrap_transfer_undone"] = given() == before
    yield from keys("ctrl+shift+z", pause=1.5)
    figures["wrap_transfer_redone"] = given() == after
    yield from keys("ctrl+z", pause=1.5)  # the armature poses the scan; landmarks stay


def target_gone(figures, folder):
    """Deletes the target while the object is wrapped onto it again; then reopens the file."""
    yield from click(WRAP, pause=1.0)
    was_running = jobs.running() is not None
    bpy.data.objects.remove(bpy.data.objects["Scan"])
    yield from until_idle(400.0)
    yield 1.0
    stage.picture(folder, "wrap-target-gone")
    figures["wrap_outlives_its_target"] = was_running and fielded(bpy.data.objects["Body"])
    before, path = shape(), str(folder / "wrapped.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    yield 2.0
    figures["wrap_opened_again"] = np.array_equal(shape(), before)
    yield from sequence(figures, folder)


def sequence(figures, folder):
    """Wrap Sequence onto a scan that rises from frame 1 to 2: Esc in the first frame, then complete; undo."""
    body = bpy.data.objects["Body"]
    shutil.rmtree(folder / "cache", ignore_errors=True)
    with stage.override():
        body.arapfields.wrap.frames = home = bpy.data.collections.new("Scans")
        bpy.context.scene.collection.children.link(home)
        for number in (1, 2):
            scan, _ = wraps.scan_of(wraps.grown_parts())
            scan.name, scan.location = f"scan_{number}", SCAN_AT + Vector((0, 0, 0.1 * number))
            home.objects.link(scan)
        for entry in body.arapfields.wrap.landmarks:  # the target's landmarks were deleted with it
            bpy.data.objects.remove(entry.on_target)
        scenes.activate(body)
        bpy.ops.ed.undo_push(message="scans")
    yield SETTLED
    before, stack = shape(), [m.type for m in body.modifiers]
    yield from click(SEQUENCE, pause=1.0)
    was_running = jobs.running() is not None
    stage.picture(folder, "wrap-sequence")
    stage.tool("mousemove", 600, 500)
    yield from keys("Escape", pause=0.1)
    yield from until_idle(20.0)
    figures["sequence_escape"] = was_running and [m.type for m in body.modifiers] == stack
    yield from click(SEQUENCE, pause=1.0)
    yield from until_idle(400.0)
    heights = []
    for frame in (1, 2):
        bpy.context.scene.frame_set(frame)
        heights.append(shape()[:, 2].mean())
    figures["sequence_rises_by"] = round(float(heights[1] - heights[0]), 3)
    yield 0.6
    stage.picture(folder, "wrap-sequence-done")
    stage.tool("mousemove", 600, 500)
    yield from keys("ctrl+z", pause=1.5)
    stack_now = [m.type for m in bpy.data.objects["Body"].modifiers]
    figures["sequence_undone"] = stack_now == stack and np.array_equal(shape(), before)


def fielded(item):
    return modifier_stack.find(item) is not None
