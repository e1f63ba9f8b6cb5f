# SPDX-License-Identifier: GPL-3.0-or-later
"""Films the steps of the guide's page on pins in a window, by mouse, with a picture after each move.

blender --factory-startup --window-geometry 0 0 880 620 --python tests/gui/window.py -- FOLDER film=PINS.blend
Writes FOLDER/NNN.png and film.json, with the cursor's position and button in each picture.
"""

import json

import bpy
import numpy as np
import stage
from mathutils import Euler
from support.blender import scenes

FEET = ((0.33, -0.05, 0.10), (-0.24, -0.10, 0.10))
DRAGS = (((0.15, -0.80, 1.42), (-22, -58)), ((0.02, 1.30, 0.84), (-24, -104)))  # (location, pixels to drag)
BACKGROUND = (0.16, 0.17, 0.19)
STEPS = 9


class Film:
    """Pictures of the window, with the cursor's state in each."""

    def __init__(self, folder):
        self.folder, self.frames = folder, []
        folder.mkdir(parents=True, exist_ok=True)

    def take(self, spot, pressed=False, hold=1):
        stage.picture(self.folder, f"{len(self.frames):03}")
        self.frames.append({"cursor": list(spot), "pressed": pressed, "hold": hold})

    def write(self):
        (self.folder / "film.json").write_text(json.dumps(self.frames))


def set_view(item):
    """Shows only the creature, from its front and side, without grid, and activates the tool."""
    bpy.data.collections["Studio"].hide_viewport = True
    scenes.activate(item)
    with stage.override():
        space = bpy.context.space_data
        space.show_region_ui, space.show_region_toolbar = False, True
        space.shading.color_type, space.shading.background_type = "VERTEX", "VIEWPORT"
        space.shading.background_color = BACKGROUND
        for name in (
            "show_floor",
            "show_axis_x",
            "show_axis_y",
            "show_cursor",
            "show_text",
            "show_relationship_lines",
        ):
            setattr(space.overlay, name, False)
        space.show_gizmo_navigate = False
        eye = space.region_3d
        eye.view_perspective = "PERSP"
        eye.view_rotation = Euler((1.45, 0, 1.0)).to_quaternion()
        bpy.ops.view3d.view_selected()
        eye.view_distance *= 0.80
        eye.view_location.z += 0.12
        bpy.ops.arapfields.pin_tool("INVOKE_DEFAULT")
        bpy.ops.ed.undo_push(message="stage")


def glide(film, start, end, steps=3):
    """Moves the cursor without a pressed button."""

    for step in range(1, steps + 1):
        spot = [round(a + step / steps * (b - a)) for a, b in zip(start, end, strict=True)]
        stage.tool("mousemove", *spot)
        yield 0.35
        film.take(spot)


def checks(path, figures, folder):
    film = Film(folder)
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    yield 1.0
    dinosaur = bpy.data.objects["Dinosaur"]
    set_view(dinosaur)
    yield 2.0
    rest, spot = scenes.world_points(dinosaur), (460, 500)
    stage.tool("mousemove", *spot)
    yield 0.5
    film.take(spot, hold=4)
    for number, where in enumerate(FEET, 1):
        goal = stage.pixel(where)
        yield from glide(film, spot, goal)
        stage.tool("keydown", "shift")
        yield 0.2
        stage.tool("click", 1)
        yield from stage.until(lambda count=number: len(dinosaur.arapfields.handles) == count, 8.0)
        stage.tool("keyup", "shift")
        yield 0.4
        film.take(goal, pressed=True, hold=3)
        spot = goal
    for where, by in DRAGS:
        now = scenes.world_points(dinosaur)[np.linalg.norm(rest - where, axis=1).argmin()]
        goal = stage.pixel(now)
        yield from glide(film, spot, goal)
        stage.tool("mousedown", 1)
        yield from stage.until(stage.is_dragging, 5.0)
        for step in range(1, STEPS + 1):
            spot = [round(a + step / STEPS * b) for a, b in zip(goal, by, strict=True)]
            stage.tool("mousemove", *spot)
            yield 0.15
            yield from stage.until(stage.is_followed)
            yield 0.25
            film.take(spot, pressed=True, hold=3 if step == STEPS else 1)
        yield from stage.release()
        yield 0.3
    film.take(spot, hold=10)
    figures["pins"] = [[entry.empty.name, entry.anchor] for entry in dinosaur.arapfields.handles]
    figures["moved"] = round(float(np.linalg.norm(scenes.world_points(dinosaur) - rest, axis=1).max()), 3)
    film.write()
