# SPDX-License-Identifier: GPL-3.0-or-later
"""The rules of walks, after each step: of shapes, and of everything."""

import bpy
import numpy as np

from addon.blender import references
from addon.blender.object_references import settings_of
from addon.live import sessions
from tests.blender.walk import world

from .steps import AllSteps, Steps

# The rule of a walk of shapes: what is shown is a function of what the file says, not of how one got there.
# After undo, redo and load the shape is the stored one, bit for bit. Of a live object it is a fresh solve's,
# from rest; where it is not live, nothing but a result moves it. A press without a move holds what is shown.

MOVES = {"drag", "pin", "transform", "place_source", "delete_pin", "live", "keep", "solve", "wrap"}
MAY_MOVE = {"setting", "style"}  # a held shape, where live mode follows what was changed
GIVES_SHAPE = {"live", "keep", "solve", "wrap", "delete_pin"}  # of an object that is not live afterwards


class Broken(Exception):
    """The rule is broken: by which step, at what, and by how much."""


class Shapes:
    """A walk of shapes. `tolerance`: of a live shape, as a share of the size."""

    def __init__(self, _, tolerance=1e-5):
        self.tolerance, self.steps = tolerance, Steps()
        world.build_shapes()
        self.begin()

    def begin(self):
        """What can be undone begins here."""
        bpy.ops.ed.undo_push(message="begin")
        world.settle()
        self.history, self.position = [self.note({})], 0

    def note(self, held):
        """What is shown now: of all, and of each source in local coordinates; and what holds a shape."""
        shapes = {item.name: world.shape(item) for item in world.shape_sources()}
        return world.everything(), shapes, held

    def step(self, name, seed):
        """Takes a step, after which the rule holds; returns what was done, None if nothing can be."""
        before, pushed = self.history[self.position], references.pushed
        at_end = self.position + 1 == len(self.history)
        if (name == "undo" and self.position == 0) or (name == "redo" and at_end):
            return None
        said = self.steps.take(name, np.random.default_rng(seed))
        if said is None:
            return None
        if name in ("undo", "redo"):
            self.position += 1 if name == "redo" else -1
            world.settle()
            if self.history[self.position] is None:
                self.history[self.position] = self.note({})
            self.require_same(self.history[self.position][0])
        elif name == "save":
            world.settle()
            self.require_same(before[0])
            self.begin()
        else:
            bpy.ops.ed.undo_push(message=name)
            world.settle()
            held = self.check(name, said, self.steps.old, before)
            del self.history[self.position + 1 :]
            between = [None] * (references.pushed - pushed)  # where live mode has ended
            self.history = [*self.history, *between, self.note(held)][-40:]
            self.position = len(self.history) - 1
        strays = world.strays()
        if strays:
            raise Broken(f"no Empties of their own: {strays}")
        return f"{self.steps.old}: {said}"

    def require_same(self, expected):
        found = world.everything()
        if found.keys() != expected.keys():
            raise Broken(f"{sorted(found)} are there, not {sorted(expected)}")
        for name, (place, seen) in expected.items():
            if not np.allclose(found[name][0], place, atol=1e-5):
                raise Broken(f"{name} is elsewhere")
            if found[name][1] != seen:
                shapes = self.history[self.position][1]
                item = bpy.data.objects[name]
                off = world.difference(world.shape(item), shapes[name]) if name in shapes else np.nan
                raise Broken(f"{name} is not what was stored: {off:.2g} of its size off")

    def check(self, name, said, old, before):
        """The shapes after a change; which of them are held as they are, for the next."""
        held = dict(before[2])
        for item in world.shape_sources():
            now, kind = world.shape(item), settings_of(item).live_kind
            mine = item == self.steps.source
            key = old if mine else item.name
            earlier = before[1].get(key)
            moves_along = name == "place_source" and settings_of(item).held and np.array_equal(now, earlier)
            if mine and said in ("press", "anchor"):
                held[key] = earlier
            elif mine and moves_along:
                pass  # its handles lie as before on it
            elif mine and name in MOVES and said != "cancelled drag":
                held.pop(key, None)
            if mine:
                held[item.name] = held.pop(key, None)
            stays = held.get(item.name)
            if stays is not None and mine and name in MAY_MOVE and np.any(stays != now):
                stays = held[item.name] = None
            if not mine and stays is None and np.array_equal(now, earlier):
                continue  # as it was found right
            if kind and stays is None and not waits(item, kind):
                off = world.difference(now, world.fresh_shape(item, kind))
                if not off <= self.tolerance:
                    raise Broken(f"{item.name}, live {kind}, is {off:.2g} of its size off a fresh solve")
            elif stays is not None or (not kind and not (mine and name in GIVES_SHAPE)):
                off = world.difference(now, earlier)
                if off != 0.0:
                    raise Broken(f"{item.name} ({kind or 'not live'}) moved by {off:.2g} of its size")
        return {one: kept for one, kept in held.items() if kept is not None}


def waits(item, kind):
    """Whether live mode waits for an object or a handle that is still to be chosen."""
    style, handles = settings_of(item).stylize, settings_of(item).handles
    lacks_object = style.style == "OBJECT" and style.style_object is None
    return kind == "STYLIZE" and (lacks_object or (style.use_handles and not handles))


# The rule of a walk of everything, after each step. No error but those that are said to the user. What the
# extension does to a mesh is a motion: its own points stay, unless the result is to be the mesh itself. Undo
# and redo give the step as it was, and a saved file too. No reference leads to data that are gone, and
# nothing is left over.

# Steps of the extension that leave every mesh's own points.
KEEPS_POINTS = {"live", "keep", "solve", "bake", "carry", "setting", "entry", "handle", "move_handle", "pin"}
KEEPS_POINTS |= {"frame", "keyframe", "rename", "hide", "parent", "place", "select"}


class All:
    def __init__(self, seed):
        self.steps = AllSteps()
        world.build(seed)
        self.begin()

    def begin(self):
        bpy.ops.ed.undo_push(message="begin")
        world.settle()
        self.history, self.position = [world.picture()], 0

    def step(self, name, seed):
        at_end = self.position + 1 == len(self.history)
        if (name == "undo" and self.position == 0) or (name == "redo" and at_end):
            return None
        may_move = any(settings_of(item).result in ("REPLACE", "KEY") for item in world.sources())
        points, pushed = world.rest(), references.pushed
        was_live = bool(sessions.live or sessions.live.paused)
        said = self.steps.take(name, seed)
        if said is None and pushed == references.pushed:
            if self.history[self.position] is not None:
                world.settle()
                require_same_pictures(self.history[self.position], world.picture(), "what is refused")
            return None
        if name in ("undo", "redo"):
            self.position += 1 if name == "redo" else -1
            world.settle()
            if self.history[self.position] is not None:
                require_same_pictures(self.history[self.position], world.picture(), said)
        elif name == "save":
            world.settle()
            if not was_live and self.history[self.position] is not None:
                require_same_pictures(self.history[self.position], world.picture(), said)
            self.begin()
        else:
            bpy.ops.ed.undo_push(message=name)
            world.settle()
            del self.history[self.position + 1 :]
            between = [None] * (references.pushed - pushed)  # where live mode has ended
            self.history = [*self.history, *between, world.picture()][-40:]
            self.position = len(self.history) - 1
            if name == "register":  # live mode ends with the extension, and does not come back by undo
                self.history = [None if is_live(picture) else picture for picture in self.history]
            if name in KEEPS_POINTS and not may_move:
                require_points(points, world.rest(), said)
        require_tidy()
        return f"{self.steps.old}: {said}"


def is_live(picture):
    return picture is not None and any(seen["live"] for seen in picture.values())


def require_same_pictures(expected, found, said):
    if found.keys() != expected.keys():
        lost, new = sorted(expected.keys() - found.keys()), sorted(found.keys() - expected.keys())
        raise Broken(f"{said}: lost {lost}, new {new}")
    for name, parts in expected.items():
        now = found[name]
        differing = [f"{part}: {now[part]} for {one}" for part, one in parts.items() if now[part] != one]
        if differing:
            raise Broken(f"{said}: {name} is not as it was: {'; '.join(differing)}")


def require_points(before, after, said):
    moved = [name for name in before.keys() & after.keys() if before[name] != after[name]]
    if moved:
        raise Broken(f"{said}: own points of {moved} changed")


def require_tidy():
    left = [scene.name for scene in bpy.data.scenes if scene.name.startswith("ARAP")]
    uids = {item.session_uid for item in bpy.data.objects}
    left += [f"a session of {uid}" for uid in sessions.live if uid not in uids]
    left += [f"{name}: {path} leads nowhere" for name, path in world.dangling()]
    if left:
        raise Broken(", ".join(left))
