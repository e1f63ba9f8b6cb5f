# SPDX-License-Identifier: GPL-3.0-or-later
"""The pin tool by mouse and keys: first pin, drags, Esc, anchors, deleting, rotation of the view."""

import subprocess
import time

import bpy
import live
import numpy as np
import stage
from mouse import drag, hover, is_followed, pixel, release, until
from support.blender import scenes

from addon.field_modifier import motion
from addon.live import sessions
from addon.live.prefetch import prefetch
from addon.pin_tool import drag as dragging
from addon.pin_tool import hover as hovering

SECONDS = 5.0
END = (0.9, -0.25, 0.0)  # on the bar's front


def checks(figures, folder, rate_alone=False):
    if not rate_alone:
        yield from by_hand(figures, folder)
    yield from first_and_rate(figures, folder)


def set_stage(dense=False):
    """Shows only the bar, from the front, and activates the tool."""
    stage.empty_file()
    with stage.override():
        bar = scenes.bar()
        if dense:
            stage.dense_bar()
        bpy.context.space_data.show_region_ui = False
        bpy.ops.view3d.view_all()
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.arapfields.pin_tool("INVOKE_DEFAULT")
        bpy.ops.ed.undo_push(message="stage")
    return bar


def state():
    """All names, positions and transforms, and the shape of the bar, for comparison bit by bit."""
    bpy.context.view_layer.update()
    bar = bpy.data.objects["Bar"]
    handles = [(e.empty.name, e.anchor, tuple(e.rest)) for e in bar.arapfields.handles]
    return stage.everything(), handles, scenes.world_points(bar).tobytes()


def by_hand(figures, folder):
    bar = set_stage()
    yield 0.5
    yield from beside(figures, bar)
    rest, before = scenes.world_points(bar), state()
    spot = pixel(END)
    yield from hover(spot)
    stage.picture(folder, "pins-hover")
    yield from drag(spot, (spot[0], spot[1] - 120), hold=True)
    stage.picture(folder, "pins-drag")
    figures["pins_drag_moves"] = round(float(np.abs(scenes.world_points(bar) - rest).max()), 3)
    stage.tool("key", "Escape")
    yield from release()
    figures["pins_escape_of_a_new_pin"] = state() == before
    yield from drag(spot, (spot[0], spot[1] - 120))
    placed = state()
    figures["pins_after_the_drag"] = [entry.empty.name for entry in bar.arapfields.handles]
    spot = pixel(bar.arapfields.handles[0].empty.location)
    yield from drag(spot, (spot[0] - 60, spot[1] + 90), hold=True)
    moved = state() != placed
    stage.tool("key", "Escape")
    yield from release()
    figures["pins_escape_of_a_drag"] = moved and state() == placed
    yield from anchor_turn_delete(figures, folder, bar)
    with stage.override():
        sessions.end(bpy.context, bar)


def beside(figures, bar):
    """A drag that begins beside the mesh of the selected object."""
    with stage.override():
        scenes.activate(bar)
    before, spot = state(), pixel((0.0, -0.25, 0.8))
    yield from hover(spot)
    stage.tool("mousedown", 1)
    for step in range(1, 9):
        stage.tool("mousemove", spot[0] + 10 * step, spot[1] + 2 * step)
        yield 0.05
    stage.tool("mouseup", 1)
    yield 0.8
    figures["pins_beside_the_mesh_stays"] = state() == before


def anchor_turn_delete(figures, folder, bar):
    stage.tool("keydown", "shift")
    yield from hover(pixel((-0.9, -0.25, 0.0)))
    stage.tool("click", 1)
    yield 0.5
    stage.tool("keyup", "shift")
    figures["pins_anchor"] = [entry.anchor for entry in bar.arapfields.handles] == [False, True]
    pin = bar.arapfields.handles[0].empty
    bar.arapfields.handles[0].hold_turn = True  # the Empty rotates with the surface
    spot, before = pixel(pin.location), pin.rotation_euler.copy()
    yield from hover(spot)
    stage.tool("click", 1)
    yield 0.5
    ring = (spot[0] + 46, spot[1])
    yield from drag(ring, (spot[0] + 33, spot[1] + 33))
    turned = np.degrees(pin.rotation_euler.y - before.y)
    figures["pins_ring_turns_degrees"] = round(float(turned), 1)
    stage.tool("key", "r")
    yield 0.5
    for step in range(8):
        stage.tool("mousemove", spot[0] + 33 - 5 * step, spot[1] + 33 + 3 * step)
        yield 0.1
    stage.tool("click", 1)
    yield 0.8
    figures["pins_r_turns_degrees"] = round(float(np.degrees(pin.rotation_euler.y - before.y) - turned), 1)
    stage.picture(folder, "pins-turned")
    yield from navigation(figures, folder, bar)
    count = len(bpy.data.objects)
    yield from hover(pixel(bar.arapfields.handles[1].empty.location))
    stage.tool("keydown", "ctrl")
    yield 0.2
    stage.tool("click", 1)
    yield from until(lambda: len(bar.arapfields.handles) == 1, 5.0)
    stage.tool("keyup", "ctrl")
    figures["pins_ctrl_click_deletes"] = (
        len(bar.arapfields.handles) == 1 and len(bpy.data.objects) == count - 1
    )
    stage.tool("key", "x")
    yield from until(lambda: not bar.arapfields.handles, 5.0)
    figures["pins_x_deletes_the_last"] = not bar.arapfields.handles and not bar.modifiers
    figures["pins_no_stray_object"] = [item.name for item in bpy.data.objects] == ["Bar"]


def navigation(figures, folder, bar):
    """During a drag the wheel zooms, with the pin under the cursor; with Ctrl it changes the pin's reach."""
    _, area, _ = stage.view()
    view, pin = area.spaces.active.region_3d, bar.arapfields.handles[0].empty
    spot, distance = pixel(pin.location), view.view_distance
    yield from drag(spot, (spot[0], spot[1] - 40), hold=True)
    stage.tool("click", 4)
    yield from until(lambda: view.view_distance != distance, 5.0)
    yield 0.6
    middle = pixel(pin.location)
    stage.tool("mousemove", spot[0] + 30, spot[1] - 40)
    yield 0.6
    after = pixel(pin.location)
    reach = bar.arapfields.handles[0].reach
    stage.tool("keydown", "ctrl")
    yield 0.2
    stage.tool("click", 4)
    yield from until(lambda: bar.arapfields.handles[0].reach != reach, 5.0)
    stage.tool("keyup", "ctrl")
    yield from until(is_followed)
    stage.picture(folder, "pins-reach")
    nearer = bar.arapfields.handles[0].reach
    yield from release()
    figures["pins_wheel_during_a_drag"] = {
        "zooms": view.view_distance < distance,
        "pin_moves_pixels": [b - a for a, b in zip(middle, after, strict=True)],
        "reach_before_and_after_ctrl": [round(reach, 3), round(nearer, 3)],
    }
    near = view.view_distance
    stage.tool("click", 5)
    yield from until(lambda: view.view_distance != near, 5.0)
    yield 0.6


def first_and_rate(figures, folder):
    """For 50,000 vertices: time from the press to the first shape, and shapes per second in a drag.

    The solver is set up while the cursor is over the mesh.
    """
    bar = set_stage(dense=True)
    _, area, _ = stage.view()
    area.spaces.active.overlay.show_overlays = False
    bpy.context.preferences.system.viewport_aa = "OFF"
    yield 2.0
    figures["pins_vertices"] = len(bar.data.vertices)
    spot = pixel((0.6, -0.25, -0.1))
    looks, begins = stage.Meter().watch(hovering, "surface"), stage.Meter().watch(dragging, "of_new_pin")
    yield from hover(spot)
    yield from until(lambda: prefetch.is_ready())
    shown, given = [], ["sleep", 0.02, "mousemove", spot[0], spot[1] - 6]
    original, motion.write = (
        motion.write,
        lambda *given: (shown.append(time.perf_counter()), original(*given)),
    )
    begin = time.perf_counter()
    subprocess.Popen(["xdotool", "mousedown", "1", *map(str, given)])
    while not shown and time.perf_counter() - begin < 10:
        yield 0.005
    stage.picture(folder, "pins-first")
    figures["pins_first_shape_s"] = round(shown[0] - begin, 3)
    yield 1.0
    times, stop = stage.draws()
    del shown[:]
    heights = [spot[1] - 6 - abs(50 - step % 100) for step in range(2000)]
    moves = " ".join(f"mousemove {spot[0]} {height} sleep 0.008" for height in heights)
    moving = subprocess.Popen(["xdotool", *moves.split()])
    begin, own = time.perf_counter(), time.process_time()
    yield SECONDS
    took, own = time.perf_counter() - begin, time.process_time() - own
    moving.kill()
    stop()
    motion.write = original
    figures["pins_drag"] = {
        "shapes_per_second": round(len(shown) / took, 1),
        "draws_per_second": round(len(times) / took, 1),
        "shapes_per_processor_second": round(len(shown) / own, 1),
        "window": [bpy.context.window_manager.windows[0].width, bpy.context.window_manager.windows[0].height],
        "bare_redraw_s": stage.redraw_seconds(),
    }
    figures["pins_main_thread"] = {"hover": looks.end(), "press": begins.end()}
    stage.tool("mouseup", 1)
    yield 2.0
    stage.picture(folder, "pins-dense")
    area.spaces.active.overlay.show_overlays = True
    empty = bar.arapfields.handles[0].empty
    own = time.process_time()
    figures["pins_without_drawing"] = live.without_drawing(empty)
    rate = figures["pins_without_drawing"]["updates_per_second"]
    own = (time.process_time() - own) / (rate * live.SECONDS / 2)
    figures["pins_without_drawing"]["per_processor_second"] = round(1 / own, 1)
