# SPDX-License-Identifier: GPL-3.0-or-later
"""The pin tool by mouse and keys: first pin, drags, Esc, anchors, deleting, rotation of the view.

Rounds of undo and redo: after drags, right after and during them, and after Esc. States are compared bit by
bit: names of all data-blocks, positions, transforms, the handles and the shape.
"""

import bpy
import numpy as np
import stage
from stage import drag, hover, is_dragging, is_followed, pixel, release, until
from support.blender import scenes

from addon.live import sessions

END = (0.9, -0.25, 0.0)  # on the bar's front
ROUNDS = 100  # of undo and redo
KINDS = ("objects", "meshes", "node_groups", "scenes", "collections")


def set_stage():
    """Shows only the bar, from the front, and activates the tool."""
    stage.empty_file()
    with stage.override():
        bar = scenes.bar()
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


def checks(figures, folder):
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
        yield from stage.move(spot[0] + 10 * step, spot[1] + 2 * step, pause=0.05)
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
    yield from stage.keys("r", pause=0.5)
    for step in range(8):
        yield from stage.move(spot[0] + 33 - 5 * step, spot[1] + 33 + 3 * step, pause=0.1)
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
    yield from press("x", lambda: not bar.arapfields.handles)
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
    yield from stage.move(spot[0] + 30, spot[1] - 40, pause=0.6)
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


def undo_checks(figures, folder):
    bar = set_stage()
    yield 0.5
    before, spot = state(), pixel(END)
    yield from drag(spot, (spot[0], spot[1] - 100))
    after = state()
    known = {name: set(getattr(bpy.data, name).keys()) for name in KINDS}
    yield from rested(figures, before, after)
    yield from within(figures, after)
    yield from escaped(figures, after)
    for name, names in known.items():
        figures[f"undo_stray_{name}"] = sorted(set(getattr(bpy.data, name).keys()) - names)
    stage.picture(folder, "undo")
    yield from press("ctrl+z", lambda: state() == before)
    figures["undo_to_the_start"] = state() == before
    bar = bpy.data.objects["Bar"]
    figures["undo_leaves"] = [item.name for item in bpy.data.objects], [m.name for m in bar.modifiers]


def press(key, reached):
    stage.tool("key", key)
    yield from until(reached, 5.0)


def record(figures, name, exact, is_exact):
    exact.append(is_exact)
    figures[f"undo_{name}"] = {"exact": sum(exact), "of": len(exact)}


def rested(figures, before, after):
    """Undo and redo of a drag whose shape is at rest."""
    exact = []
    for _ in range(ROUNDS):
        for key, expected in (("ctrl+z", before), ("ctrl+shift+z", after)):
            yield from press(key, lambda expected=expected: state() == expected)
            record(figures, "after_drags", exact, state() == expected)


def within(figures, after):
    """Keys have no effect while the button is pressed; undo right after the release reverts the drag, redo
    restores it, and undo reverts it again."""
    exact = []
    for number in range(ROUNDS):
        spot = pixel(bpy.data.objects["Bar"].arapfields.handles[0].empty.location)
        end = spot[0] + (-1) ** number * 20, spot[1] + 10 * (-1) ** number
        yield from drag(spot, end, steps=3, pause=0.03, hold=True)
        held = is_dragging()
        yield from stage.keys("ctrl+z", pause=0.05)
        yield from stage.keys("ctrl+shift+z", pause=0.05)
        held = held and is_dragging()
        stage.tool("mouseup", 1)
        yield 0.05 * (number % 4)  # also before the shape is at rest
        yield from press("ctrl+z", lambda: state() == after and not is_dragging())
        record(figures, "within_drags", exact, held and state() == after)
        yield from press("ctrl+shift+z", lambda: state() != after)
        again = state()
        yield from press("ctrl+z", lambda: state() == after)
        record(figures, "within_drags", exact, again != after and state() == after)


def escaped(figures, after):
    """Esc during a drag."""
    exact = []
    for number in range(ROUNDS):
        spot = pixel(bpy.data.objects["Bar"].arapfields.handles[0].empty.location)
        end = spot[0] - 30 + number % 7 * 10, spot[1] + 25
        yield from drag(spot, end, steps=3, pause=0.03, hold=number % 2 == 0)
        if number % 2 == 0:
            stage.tool("key", "Escape")
            yield from release()
        else:
            yield from press("ctrl+z", lambda: state() == after)
        record(figures, "escaped", exact, state() == after)
