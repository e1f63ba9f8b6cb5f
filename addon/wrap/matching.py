# SPDX-License-Identifier: GPL-3.0-or-later
"""Correspondence of a target's vertices to the object wrapped onto it, and its keys on the target."""

import json

import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.object_references import ObjectReference, settings_of
from ..core.errors import UserError
from ..core.geometry.spaces import is_in_place, mirrors, transform
from ..core.runtime import native
from ..handles.empties import matrix_of
from ..names import NEUTRAL_KEY
from . import transfer
from .transfer import Given

LEAST_POSE = 1e-5  # of the target's size: above the rounding of an armature at rest
FAR = 0.05  # of the target's diagonal: most median distance after a wrap
OFF = 0.01  # of the target's diagonal: farther vertices are off the wrapped shape
LOOKED_AT = 1000  # most vertices to measure the distance of two surfaces


def keeps_vertices(modifier):
    return modifier_stack.kind_keeps_vertices(modifier) or modifier_stack.is_field(modifier)


def seen(context, source, target, is_posed):
    """(n, 3) target vertices as wrapped onto: with its own keys, and with its modifiers if `is_posed`."""
    blocks, own = target.data.shape_keys, mesh_arrays.positions(target.data)
    kept = [one for one in target.modifiers if is_posed and one.show_viewport and keeps_vertices(one)]
    if not kept and blocks is None:
        return own
    given = {NEUTRAL_KEY, *(block.name for block in transfer.keys_of(source))}  # made after the wrap
    values = dict.fromkeys(given & set(blocks.key_blocks.keys() if blocks else ()), 0.0)
    shape = transfer.shape_at(context, target, kept, values)
    return shape if len(shape) == len(own) else own


def mark_of(target):
    """Fingerprint of the target's own vertices and faces, as text."""
    digest, faces = mesh_arrays.fingerprint(target.data)
    return f"{digest.hex()} {faces}"


class Wrapped:
    """The input of a wrap, stored for a later transfer."""

    def __init__(self, source, target):
        self.ends = ObjectReference(source), ObjectReference(target)
        self.shown_keys, self.mark = json.dumps(transfer.shown_values(source)), mark_of(target)

    def put(self):
        source, target = (end.find() for end in self.ends)
        wrap = settings_of(source).wrap
        wrap.shown_keys, wrap.target_mark = self.shown_keys, self.mark if wrap.onto == target else ""
        wrap.beside_target = beside(source, target).ravel() if wrap.onto == target else np.zeros(16)


def beside(source, target):
    """(4, 4) from a source's local coordinates to its target's."""
    return np.linalg.inv(matrix_of(target)) @ matrix_of(source)


def distance(points, surface):
    """Median distance of the points from a surface."""
    return np.median(np.abs(surface(points[:: -(-len(points) // LOOKED_AT)])))


class Match:
    """Match of one source and one target: read on the main thread, computed on any."""

    def __init__(self, context, source, target, with_keys):
        self.ends = ObjectReference(source), ObjectReference(target)
        self.given = Given(context, source)
        self.place_at(beside(source, target))
        self.mirror = self.given.mirror(self.placement)
        self.triangles, self.mark = mesh_arrays.triangles(target.data), mark_of(target)
        wrap = settings_of(source).wrap
        self.is_edited = target == wrap.onto and wrap.target_mark not in ("", self.mark)
        kept = np.array(wrap.beside_target, dtype=np.float64).reshape(4, 4)
        is_known = target == wrap.onto and kept.any() and mirrors(kept) == mirrors(self.placement)
        self.kept = kept if is_known else None  # where it lay when it was wrapped
        self.unposed, self.posed = (seen(context, source, target, is_posed) for is_posed in (False, True))
        self.offsets = transfer.key_offsets(source) if with_keys else None

    def find(self, tracker):
        """Finds the target vertices' correspondence, and the displacements (k, m, 3) of its keys."""
        with_keys = self.offsets is not None
        task = tracker.start("Comparing", 0.3 if with_keys else 1.0)
        wrapped = native.library().MeshSdf(self.moved, self.given.triangles)
        if self.kept is not None and self.met(wrapped) is None:
            self.place_at(self.kept)
            wrapped = native.library().MeshSdf(self.moved, self.given.triangles)
        self.own = self.met(wrapped)
        if self.own is None:
            raise UserError(
                "{name} does not lie on {target}; move it back, or wrap again",
                self.ends[0],
                target=self.ends[1].name,
            )
        tracker.warnings += self.off(wrapped) if self.is_edited else []
        self.places = self.places_of(self.own, self.triangles, task)
        self.displacements = self.carried(tracker.start("Shape Keys", 1.0)) if with_keys else None

    def get(self):
        """The source and the target; UserError if one has changed since it was read."""
        source, target = (end.get() for end in self.ends)
        now = self.placement if self.is_aside else beside(source, target)
        is_there = is_in_place(transform(now, self.given.moved), self.moved)
        has_same_keys = self.offsets is None or np.array_equal(transfer.key_offsets(source), self.offsets)
        if not (is_there and has_same_keys):
            raise UserError("{name} changed while it was worked on; run again", source)
        if mark_of(target) != self.mark:
            raise UserError("{name} changed while it was worked on; run again", target)
        return source, target

    @property
    def is_aside(self):
        """Whether the wrapped source was moved off its target since."""
        return self.placement is self.kept

    def place_at(self, placement):
        """Places the wrapped source by (4, 4), from its local coordinates to the target's."""
        self.placement, self.moved = placement, transform(placement, self.given.moved)

    def met(self, wrapped):
        """The target's vertices at the time of the wrap: unposed or posed, whichever is nearer.

        None if most vertices of the wrapped source and of the target are far from each other.
        """
        distances = [distance(vertices, wrapped) for vertices in (self.unposed, self.posed)]
        own = self.unposed if distances[0] <= distances[1] else self.posed
        far = FAR * np.linalg.norm(np.ptp(own, axis=0))
        if min(distances) > far and distance(self.moved, native.library().MeshSdf(own, self.triangles)) > far:
            return None
        return own

    def off(self, wrapped):
        """[UserError] if vertices of the target, edited since the wrap, are off the wrapped source."""
        far = OFF * np.linalg.norm(np.ptp(self.own, axis=0))
        count = np.count_nonzero(np.abs(wrapped(self.own)) > far)
        if not count:
            return []
        edited = UserError(
            "{target} was edited after the wrap; vertices that no longer lie on {name}: {count}",
            self.ends[0],
            target=self.ends[1].name,
            count=count,
        )
        return [edited]

    def places_of(self, vertices, triangles, task=None):
        """The native Correspondence of a mesh's vertices to the wrapped source."""
        rest = self.given.rest @ self.mirror, self.given.triangles
        return native.library().Correspondence(self.moved, rest, (vertices, triangles), task=task)

    def carried(self, task):
        """(k, m, 3) displacements of the source's keys, posed as the target is."""
        carried = self.places.displacements(self.offsets @ self.mirror, task=task)
        if np.abs(self.own - self.unposed).max() <= LEAST_POSE * np.ptp(self.own, axis=0).max():
            return carried
        posed, unposed = (self.own, self.triangles), (self.unposed, self.triangles)
        return native.library().Correspondence(self.unposed, posed, unposed).displacements(carried, task=task)
