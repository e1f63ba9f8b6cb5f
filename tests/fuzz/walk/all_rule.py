# SPDX-License-Identifier: GPL-3.0-or-later
"""The rule of a walk of everything, after each step.

No error but those that are said to the user. What the extension does to a mesh is a motion: its own points
stay, unless the result is to be the mesh itself. Undo and redo give the step as it was, and a saved file too.
No reference leads to data that are gone, and nothing is left over.
"""

import bpy

from addon.blender import undo_steps
from addon.blender.object_references import settings_of
from addon.live import sessions
from tests.blender.walk import world

from . import all_scene
from .all_steps import AllSteps
from .rule import Broken

# Steps of the extension that leave every mesh's own points.
KEEPS_POINTS = {"live", "keep", "solve", "bake", "carry", "setting", "entry", "handle", "move_handle", "pin"}
KEEPS_POINTS |= {"frame", "keyframe", "rename", "hide", "parent", "place", "select"}


class All:
    def __init__(self, seed):
        self.steps = AllSteps()
        all_scene.build(seed)
        self.begin()

    def begin(self):
        bpy.ops.ed.undo_push(message="begin")
        world.settle()
        self.history, self.position = [all_scene.picture()], 0

    def step(self, name, seed):
        at_end = self.position + 1 == len(self.history)
        if (name == "undo" and self.position == 0) or (name == "redo" and at_end):
            return None
        may_move = any(settings_of(item).result in ("REPLACE", "KEY") for item in all_scene.sources())
        points, was_live, pushed = all_scene.rest(), dict(sessions.live), undo_steps.pushed
        said = self.steps.take(name, seed)
        if said is None and pushed == undo_steps.pushed:
            if self.history[self.position] is not None:
                world.settle()
                require_same(self.history[self.position], all_scene.picture(), "what is refused")
            return None
        if name in ("undo", "redo"):
            self.position += 1 if name == "redo" else -1
            world.settle()
            if self.history[self.position] is not None:
                require_same(self.history[self.position], all_scene.picture(), said)
        elif name == "save":
            world.settle()
            if not was_live and self.history[self.position] is not None:
                require_same(self.history[self.position], all_scene.picture(), said)
            self.begin()
        else:
            bpy.ops.ed.undo_push(message=name)
            world.settle()
            del self.history[self.position + 1 :]
            between = [None] * (undo_steps.pushed - pushed)  # where live mode has ended
            self.history = [*self.history, *between, all_scene.picture()][-40:]
            self.position = len(self.history) - 1
            if name == "register":  # live mode ends with the extension, and does not come back by undo
                self.history = [None if is_live(picture) else picture for picture in self.history]
            if name in KEEPS_POINTS and not may_move:
                require_points(points, all_scene.rest(), said)
        require_tidy()
        return f"{self.steps.old}: {said}"


def is_live(picture):
    return picture is not None and any(seen["live"] for seen in picture.values())


def require_same(expected, found, said):
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
    left += [f"{name}: {path} leads nowhere" for name, path in all_scene.dangling()]
    if left:
        raise Broken(", ".join(left))
