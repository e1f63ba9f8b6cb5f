# SPDX-License-Identifier: GPL-3.0-or-later
"""Wrap by mouse: target, landmarks, Wrap, Esc, undo and redo."""

import types

import bpy
import numpy as np
import panel
import stage
from mathutils import Vector
from stage import click, keys, pixel, until_idle
from support.blender import character, scenes, wraps

from addon.blender import modifier_stack
from addon.core.runtime import jobs

SCAN_AT = Vector((2.0, 0, 0))
# Positions in the sidebar of a window of 1600 × 1000, with only Wrap open, below its header.
EYEDROPPER, BUTTON, WRAP = ((x, panel.HEADER[1] + y) for x, y in ((1263, 30), (1155, 76), (1155, 307)))
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
        rig.show_in_front = True
        scenes.activate(body)
        bpy.ops.view3d.view_all()
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.ed.undo_push(message="stage")
    yield 2.0
    yield from panel.open_alone({"wrap"})
    yield SETTLED


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
    yield from stage.move(500, 850, pause=0.6)
    stage.picture(folder, "wrap-landmarks")


def inward(end, middle, by=0.03):
    """The pixel of a point just inside the outline."""
    return pixel(end + by * (middle - end).normalized())


def shape():
    return scenes.world_points(bpy.data.objects["Body"])


def press(figures, folder):
    """Presses Esc in the first wrap; a complete one is undone, redone and posed."""
    body, rig = bpy.data.objects["Body"], bpy.data.objects["Rig"]
    rest, bones = shape(), wraps.joints(rig, posed=False)
    yield from click(WRAP, pause=1.0)
    was_running = jobs.running() is not None
    stage.tool("mousemove", 600, 500)
    yield from keys("Escape", pause=0.1)
    yield from until_idle(20.0)
    yield 0.5
    figures["wrap_escape"] = was_running and np.array_equal(shape(), rest) and not fielded(body)
    yield from click(WRAP, pause=1.0)
    stage.picture(folder, "wrap-running")
    yield from until_idle(400.0)
    yield 1.0
    yield from stage.move(500, 850, pause=0.6)
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


def fielded(item):
    return modifier_stack.find(item) is not None
