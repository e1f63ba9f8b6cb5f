# SPDX-License-Identifier: GPL-3.0-or-later
"""Rounds of undo and redo with the active pin tool: after drags, right after and during them, and after Esc.

States are compared bit by bit: names of all data-blocks, positions, transforms, the handles and the shape.
"""

import bpy
import stage
from mouse import drag, is_dragging, pixel, release, until
from pins import END, set_stage, state

ROUNDS = 100
STRIDE = 5  # states between prints


def checks(figures, folder, kinds=("rested", "within", "escaped")):
    """`kinds`: the rounds to run."""
    bpy.context.preferences.system.viewport_aa = "OFF"  # not needed for undo steps
    bar = set_stage()
    yield 0.5
    before, spot = state(), pixel(END)
    yield from drag(spot, (spot[0], spot[1] - 100))
    after = state()
    known = {name: set(getattr(bpy.data, name).keys()) for name in KINDS}
    if "rested" in kinds:
        yield from rested(figures, before, after)
    if "within" in kinds:
        yield from within(figures, after)
    if "escaped" in kinds:
        yield from escaped(figures, after)
    for name, names in known.items():
        figures[f"undo_stray_{name}"] = sorted(set(getattr(bpy.data, name).keys()) - names)
    stage.picture(folder, "undo")
    stage.tool("key", "ctrl+z")
    yield from until(lambda: state() == before, 5.0)
    figures["undo_to_the_start"] = state() == before
    bar = bpy.data.objects["Bar"]
    figures["undo_leaves"] = [item.name for item in bpy.data.objects], [m.name for m in bar.modifiers]


KINDS = ("objects", "meshes", "node_groups", "scenes", "collections")


def record(figures, name, exact):
    figures[f"undo_{name}"] = {"exact": sum(exact), "of": len(exact)}
    if len(exact) % STRIDE == 0:
        print(name, figures[f"undo_{name}"], flush=True)


def rested(figures, before, after):
    """Undo and redo of a drag whose shape is at rest."""
    exact = []
    for _ in range(ROUNDS):
        for key, expected in (("ctrl+z", before), ("ctrl+shift+z", after)):
            stage.tool("key", key)
            yield from until(lambda expected=expected: state() == expected, 5.0)
            exact.append(state() == expected)
            record(figures, "after_drags", exact)


def within(figures, after):
    """Keys have no effect while the button is pressed; undo right after the release reverts the drag, redo
    restores it, and undo reverts it again."""
    exact = []
    for number in range(ROUNDS):
        spot = pixel(bpy.data.objects["Bar"].arapfields.handles[0].empty.location)
        end = spot[0] + (-1) ** number * 20, spot[1] + 10 * (-1) ** number
        yield from drag(spot, end, steps=3, pause=0.03, hold=True)
        held = is_dragging()
        stage.tool("key", "ctrl+z")
        yield 0.05
        stage.tool("key", "ctrl+shift+z")
        yield 0.05
        held = held and is_dragging()
        stage.tool("mouseup", 1)
        yield 0.05 * (number % 4)  # also before the shape is at rest
        stage.tool("key", "ctrl+z")
        yield from until(lambda: state() == after and not is_dragging(), 5.0)
        exact.append(held and state() == after)
        record(figures, "within_drags", exact)
        stage.tool("key", "ctrl+shift+z")
        yield from until(lambda: state() != after, 5.0)
        again = state()
        stage.tool("key", "ctrl+z")
        yield from until(lambda: state() == after, 5.0)
        exact.append(again != after and len(bpy.data.objects) == 2 and state() == after)
        record(figures, "within_drags", exact)


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
            stage.tool("key", "ctrl+z")
        yield from until(lambda: state() == after, 5.0)
        exact.append(state() == after)
        record(figures, "escaped", exact)
