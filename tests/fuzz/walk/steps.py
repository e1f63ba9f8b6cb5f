# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of a walk of shapes, by the operators and calls that the window's gestures make.

A step changes the scene as a user does and returns what it did; None where it cannot be done now.
"""

import tempfile

import bpy
import numpy as np
from mathutils import Euler, Vector
from support.blender import scenes

from addon.live import sessions
from addon.pin_tool import drag, pins
from tests.blender.walk import world

STYLES = ("CUBE", "OCTAHEDRON", "ICOSAHEDRON", "CYLINDER")
FRAMES = ("OBJECT", "WORLD", "UPRIGHT")
SHORT = {"iterations": 20, "samples": 400}


class Steps:
    """`source` is the object that the step at hand works on, `old` its name before; `rng` is drawn from."""

    def __init__(self):
        self.rng, self.source, self.old = None, None, ""

    def take(self, name, rng):
        self.rng, items = rng, world.sources()
        self.source = items[rng.integers(len(items))]
        self.old = self.source.name
        scenes.activate(self.source)
        return getattr(self, name)()

    @property
    def settings(self):
        return self.source.arapfields

    def size(self):
        return float(np.ptp(scenes.world_points(self.source), axis=0).max())

    def place(self):
        points = scenes.world_points(self.source)
        return points[self.rng.integers(len(points))]

    def look(self):
        """The window's timer may have come round, with a shape or without."""
        if self.rng.random() < 0.6:
            bpy.context.view_layer.update()
            sessions.update(bpy.context, wait=world.WAIT if self.rng.random() < 0.5 else 0.0)

    def moves(self, dragged):
        start = np.array(dragged.empty.get().matrix_world.translation)
        way = self.rng.normal(size=3) * 0.2 * self.size()
        if self.rng.random() < 0.25:
            dragged.turn(bpy.context, Vector(self.rng.normal(size=3)).normalized(), self.rng.normal())
        for share in np.linspace(0, 1, self.rng.integers(2, 5))[1:]:
            dragged.move(bpy.context, start + share * way)
            self.look()

    def pin(self):
        if len(self.settings.handles) >= 4 or pins.refusal(self.source) is not None:
            return None
        where, anchor = self.place(), self.rng.random() < 0.4
        dragged = drag.of_new_pin(bpy.context, self.source, where, 0.15 * self.size(), anchor=anchor)
        if not anchor:
            self.moves(dragged)
        dragged.end(bpy.context)
        return "anchor" if anchor else "drag of a new pin"

    def entry(self):
        entries = list(self.settings.handles)
        return entries[self.rng.integers(len(entries))] if entries else None

    def drag(self):
        entry = self.entry()
        if entry is None or pins.refusal(self.source) is not None:
            return None
        dragged, way = drag.of_entry(bpy.context, self.source, entry), self.rng.random()
        if way > 0.15:
            self.moves(dragged)
        if way > 0.85:
            dragged.cancel(bpy.context)
            return "cancelled drag"
        dragged.end(bpy.context)
        return "drag" if way > 0.15 else "press"

    def transform(self):
        """G, R or S of pins, of which the extension hears by the scene alone."""
        if not self.settings.handles:
            return None
        for number, entry in enumerate(self.settings.handles):
            if number == 0 or self.rng.random() < 0.6:
                empty = entry.empty
                empty.location += Vector(self.rng.normal(size=3) * 0.1 * self.size())
                if self.rng.random() < 0.4:
                    empty.rotation_euler.rotate(Euler(self.rng.normal(size=3) * 0.4))
                if self.rng.random() < 0.1:
                    empty.scale *= 1.3
        self.look()
        return "G, R, S of pins"

    def place_source(self):
        """G, R or S of the object, or of its parent."""
        item = self.source.parent or self.source
        item.location += Vector(self.rng.normal(size=3) * 0.1)
        item.rotation_euler.rotate(Euler(self.rng.normal(size=3) * 0.2))
        if self.rng.random() < 0.3:
            item.scale *= 1.1
        if self.rng.random() < 0.2:
            item.scale.z *= 1.1
        return "G, R, S of the object"

    def live(self):
        kind = "DEFORM" if self.settings.handles and self.rng.random() < 0.6 else "STYLIZE"
        try:
            bpy.ops.arapfields.live(kind=kind)
        except RuntimeError:
            return None
        return f"Live {kind}"

    def keep(self):
        if not sessions.is_live(self.source):
            return None
        bpy.ops.arapfields.live_keep()
        return "Keep Shape"

    def style(self):
        style, which = self.settings.stylize, self.rng.integers(6)
        if which < 2:
            style.style = str(self.rng.choice(STYLES))
        elif which == 2:
            style.strength = float(self.rng.choice((0.0, 0.5, 1.0)))
        elif which == 3:
            style.frame = str(self.rng.choice(FRAMES))
        elif which == 4:
            style.use_handles = not style.use_handles
        else:  # still to be chosen
            chosen = bpy.data.objects["Die"] if self.rng.random() < 0.5 else None
            style.style, style.style_object = "OBJECT", chosen
        self.look()
        return "style"

    def setting(self):
        entry, which = self.entry(), self.rng.integers(4)
        if which == 0:
            self.settings.deform.bending = float(self.rng.choice((0.05, 0.1, 1.0)))
        elif which == 1:
            self.settings.stylize.keep_stance = float(self.rng.choice((0.1, 1.0)))
        elif entry is not None and which == 2:
            entry.weight = float(self.rng.choice((0.5, 1.0, 2.0)))
        elif entry is not None:
            entry.anchor = not entry.anchor
        self.look()
        return "setting"

    def delete_pin(self):
        entry = self.entry()
        if entry is None:
            return None
        pins.select(bpy.context, entry.empty)
        bpy.ops.arapfields.pin_delete()
        return "pin deleted"

    def delete(self):
        if len(world.sources()) < 3:
            return None
        bpy.ops.object.delete()
        return "object deleted"

    def rename(self):
        self.source["walks"] = self.source.get("walks", self.source.name)
        self.source.name = f"Renamed {self.rng.integers(1000)}"
        return "renamed"

    def solve(self):
        """Deform or Stylize, onto the modifier."""
        name = "deform" if self.settings.handles and self.rng.random() < 0.6 else "stylize"
        try:
            getattr(bpy.ops.arapfields, name)(**SHORT)
        except RuntimeError:
            return None
        return name

    def wrap(self):
        others = [item for item in world.sources() if item != self.source]
        self.settings.wrap.onto = others[self.rng.integers(len(others))]
        bpy.ops.arapfields.wrap(samples=400, iterations=3, centers=20, stages=1)
        return "wrap"

    def mode(self):
        name = str(self.rng.choice(("EDIT", "SCULPT", "WEIGHT_PAINT")))
        bpy.ops.object.mode_set(mode=name)
        self.look()
        bpy.ops.object.mode_set(mode="OBJECT")
        return name

    def undo(self):
        bpy.ops.ed.undo()
        return "undo"

    def redo(self):
        bpy.ops.ed.redo()
        return "redo"

    def save(self):
        with tempfile.TemporaryDirectory() as folder:
            bpy.ops.wm.save_as_mainfile(filepath=f"{folder}/walk.blend")
            bpy.ops.wm.open_mainfile(filepath=f"{folder}/walk.blend")
        return "save and reload"
