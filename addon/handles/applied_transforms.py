# SPDX-License-Identifier: GPL-3.0-or-later
"""Follows Apply Transforms and Set Origin, which change vertices and matrix of an object against each other.

Rest boxes, reaches and offsets are in the object's coordinates, so that they change alike. Blender has pushed
its step of undo by then: the same change follows again when that step is restored.
"""

import hashlib
from dataclasses import dataclass

import bpy
import numpy as np

from ..blender import modifier_stack
from ..blender.object_references import settings_of
from ..core.geometry.spaces import inverse, transform
from ..field_modifier import layers, motion
from . import movers

COMPARED = 64  # number of vertices whose places are compared
SAME = 1e-4  # of the compared vertices' extent: tolerance for a place in the world


@dataclass(frozen=True)
class Placement:
    """An object's matrix, (4, 4), and some of its vertices, (k, 3) in its coordinates, of `count`."""

    matrix: np.ndarray
    points: np.ndarray
    count: int

    def change_since(self, earlier):
        """(4, 4) earlier → present coordinates if the vertices have kept their places while both have
        changed; else None."""
        if self.count != earlier.count or not self.count or np.array_equal(self.points, earlier.points):
            return None
        before, now = (transform(one.matrix, one.points) for one in (earlier, self))
        extent = max(np.ptp(before, axis=0).max(), np.ptp(now, axis=0).max())
        if np.abs(now - before).max() > SAME * extent or not np.linalg.det(self.matrix[:3, :3]):
            return None
        change = inverse(self.matrix) @ earlier.matrix
        moved = np.abs(transform(change, earlier.points) - earlier.points).max()
        return change if moved > SAME * np.ptp(earlier.points, axis=0).max() else None


seen = {}  # {session_uid: Placement} at the last check
followed = {}  # {state of an object before a change has been followed: that change}


def placement_of(source):
    vertices, matrix = source.data.vertices, np.array(source.matrix_world, dtype=np.float64)
    some = np.linspace(0, len(vertices) - 1, min(COMPARED, len(vertices))).astype(int).tolist()
    points = np.array([vertices[index].co for index in some], dtype=np.float64)
    return Placement(matrix, points.reshape(-1, 3), len(vertices))


def is_watched(item):
    """Whether an object has handles or a motion, in its own coordinates, and can be changed."""
    if not isinstance(item, bpy.types.Object) or item.type != "MESH" or item.mode != "OBJECT":
        return False
    if item.library is not None or item.override_library is not None:
        return False
    return bool(settings_of(item).handles) or modifier_stack.find(item) is not None


def follow(depsgraph):
    """Checks the objects that a depsgraph has updated; returns those that were changed."""
    updates = [one for one in depsgraph.updates if one.is_updated_transform or one.is_updated_geometry]
    return [one.id.original for one in updates if is_watched(one.id.original) and check(one.id.original)]


def check(source):
    now, before = placement_of(source), seen.get(source.session_uid)
    change = None if before is None else now.change_since(before)
    if change is not None:
        followed[state_of(source, now)] = change
        apply(source, change)
    seen[source.session_uid] = now
    return change is not None


def after_undo():
    """Repeats the changes that steps of undo do not have; what undo has moved is no change. Returns the
    objects that were changed."""
    changed = []
    for source in filter(is_watched, list(bpy.data.objects)):
        now = placement_of(source)
        change = followed.get(state_of(source, now)) if followed else None
        if change is not None:
            apply(source, change)
            changed.append(source)
        seen[source.session_uid] = now
    return changed


def state_of(source, placement):
    shown, hashed = motion.snapshot(source), hashlib.sha1(placement.points.tobytes())
    for entry in settings_of(source).handles:
        hashed.update(np.array(entry.rest).tobytes())
    if shown is not None and shown.offsets is not None:
        hashed.update(shown.offsets.tobytes())
    return source.session_uid, hashed.digest()


def apply(source, change):
    """Applies a change of coordinates, (4, 4), to what is stored in them."""
    settings, scale = settings_of(source), float(np.cbrt(abs(np.linalg.det(change[:3, :3]))))
    for entry in settings.handles:
        entry.rest = (change @ movers.rest_of(entry)).ravel()
        unwrapped = np.array(entry.unwrapped, dtype=np.float64).reshape(4, 4)
        entry.unwrapped = (change @ unwrapped).ravel() if unwrapped.any() else unwrapped.ravel()
        entry.reach *= scale
    settings.keep_beyond *= scale
    left, _, right = np.linalg.svd(change[:3, :3])
    turn = np.linalg.det(left @ right) * (left @ right)  # of an axis, which a reflection reverses
    for modifier in filter(None, (modifier_stack.find(source), *modifier_stack.layers(source))):
        mesh = motion.carrier(source, modifier)
        number = layers.parts(modifier)[1] if modifier_stack.is_layer(modifier) else ""
        moved = motion.read_from(mesh, number)
        if moved.offsets is not None:
            turns = None if moved.turns is None else moved.turns @ turn.T
            motion.write_to(mesh, motion.Motion(moved.offsets @ change[:3, :3].T, turns), number)
