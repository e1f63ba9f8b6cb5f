# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a target lies on the object that was wrapped onto it, and what that makes of the object's keys."""

import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.object_references import ObjectReference
from ..core.errors import UserError
from ..core.geometry.spaces import transform
from ..core.runtime import native
from ..handles.empties import matrix_of
from ..names import NEUTRAL_KEY
from . import keys
from .given import Given

LEAST_POSE = 1e-5  # of the target's size: an armature at rest moves by less, by rounding
LEAST_MOVE = 1e-4  # of the source's size: more than rounding where both are moved together
FAR = 0.05  # of the target's diagonal: a wrap leaves half of the vertices nearer than that
LOOKED_AT = 1000  # vertices at most, to see how far two surfaces are apart


def keeps_vertices(modifier):
    return modifier.type in modifier_stack.KEEPING or modifier_stack.is_field(modifier)


def to_target(source, target):
    """(4, 4) from the source's coordinates into the target's."""
    return np.linalg.inv(matrix_of(target)) @ matrix_of(source)


def seen(context, source, target, is_posed):
    """(n, 3) vertices of the target as a wrap sees them, by its own keys, and by its modifiers or not."""
    blocks, own = target.data.shape_keys, mesh_arrays.positions(target.data)
    kept = [one for one in target.modifiers if is_posed and one.show_viewport and keeps_vertices(one)]
    if not kept and blocks is None:
        return own
    given = {NEUTRAL_KEY, *(block.name for block in keys.of(source))}  # the wrap was without these
    values = dict.fromkeys(given & set(blocks.key_blocks.keys() if blocks else ()), 0.0)
    shape = keys.shape_at(context, target, kept, values)
    return shape if len(shape) == len(own) else own


def distance(points, mesh):
    """How far from the surface of a mesh, its vertices and triangles, half of the points are at most."""
    surface = native.library().MeshSdf(*mesh)
    return np.median(np.abs(surface(points[:: -(-len(points) // LOOKED_AT)])))


class Match:
    """One source and one target: read on the main thread, compared on any."""

    def __init__(self, context, source, target, with_keys):
        self.ends = ObjectReference(source), ObjectReference(target)
        self.given = Given(context, source)
        self.to_target, self.mark = to_target(source, target), mesh_arrays.fingerprint(target.data)
        self.moved = transform(self.to_target, self.given.moved)  # in the target's coordinates, as keys are
        self.triangles = mesh_arrays.triangles(target.data)
        self.unposed, self.posed = (seen(context, source, target, is_posed) for is_posed in (False, True))
        self.offsets = keys.offsets(source) if with_keys else None

    def find(self, tracker):
        """Finds the places of the target's vertices, and the displacements (k, m, 3) of its keys."""
        with_keys = self.offsets is not None
        task = tracker.start("Comparing", 0.3 if with_keys else 1.0)
        self.own = min((self.unposed, self.posed), key=self.distance)
        self.refuse_elsewhere()
        self.places = self.places_of(self.own, self.triangles, task)
        self.displacements = self.carried(tracker.start("Shape Keys", 1.0)) if with_keys else None

    def get(self):
        """The source and the target; UserError where one is not as it was read."""
        source, target = (end.get() for end in self.ends)
        moved = np.abs(transform(to_target(source, target), self.given.moved) - self.moved).max()
        is_there = moved <= LEAST_MOVE * np.ptp(self.moved, axis=0).max()
        has_same_keys = self.offsets is None or np.array_equal(keys.offsets(source), self.offsets)
        if not (is_there and has_same_keys):
            raise UserError("{name} changed while it was worked on; run again", source)
        if mesh_arrays.fingerprint(target.data) != self.mark:
            raise UserError("{name} changed while it was worked on; run again", target)
        return source, target

    def distance(self, vertices):
        """How far from the wrapped source these are: a pose may have come after the wrap."""
        return distance(vertices, (self.moved, self.given.triangles))

    def refuse_elsewhere(self):
        """UserError where most of the wrapped source and most of the target lie far from the other."""
        far = FAR * np.linalg.norm(np.ptp(self.own, axis=0))
        if self.distance(self.own) > far and distance(self.moved, (self.own, self.triangles)) > far:
            raise UserError(
                "{name} does not lie on {target}; move it back, or wrap again",
                self.ends[0],
                target=self.ends[1].name,
            )

    def places_of(self, vertices, triangles, task=None):
        """Where the vertices of a mesh lie on the wrapped source."""
        rest = self.given.rest, self.given.triangles
        return native.library().Correspondence(self.moved, rest, (vertices, triangles), task=task)

    def carried(self, task):
        """(k, m, 3) of the source's keys: what poses the target poses these too."""
        carried = self.places.displacements(self.offsets, task=task)
        if np.abs(self.own - self.unposed).max() <= LEAST_POSE * np.ptp(self.own, axis=0).max():
            return carried
        seen, unposed = (self.own, self.triangles), (self.unposed, self.triangles)
        return native.library().Correspondence(self.unposed, seen, unposed).displacements(carried, task=task)
