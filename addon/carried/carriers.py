# SPDX-License-Identifier: GPL-3.0-or-later
"""Carriers: how each type of carried object is read, and how it receives the field's motion.

Each has `points`, (n, 3) in its own coordinates at rest. `moved(rest, now, parent, after)` runs on a worker:
rest, now and parent are (4, 4) matrices to solve space, `after` the (n, 3) moved points there; `write` puts
the result onto the object, on the main thread.
"""

import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..core.errors import UserError, refuse
from ..core.geometry.spaces import inverse, transform
from ..field_modifier import motion


class Carrier:
    """Base class. `before`: snapshot of the object from when it was bound, to be restored."""

    base_kind = "NONE"  # the entry's `base_kind` while this carrier moves the object

    def __init__(self, context, item):
        self.points = self.read(context, item)
        if not len(self.points):
            raise UserError("{name} is empty; it is not carried", item)
        if not np.isfinite(self.points).all():
            raise UserError("{name} has points at invalid locations; it is not carried", item)

    @staticmethod
    def is_on(item):
        """Whether the field moves the object's points."""
        return modifier_stack.find(item) is not None

    def basis(self, item, entry, depsgraph):
        """The object's own transform without the field's, if it is moved as a whole; else None."""
        return None

    def moved(self, rest, now, parent, after):
        return np.ascontiguousarray(transform(inverse(now), after), dtype=np.float32)

    def present(self, item, entry):
        """The shape that was written last; None if there is none or it is unknown."""
        return None

    def rebased(self, shape, own, parent):
        """A shape by `moved` in new coordinates: (4, 4) `own` maps the object's to them, `parent` its
        parent's."""
        return np.ascontiguousarray(transform(own, shape), dtype=np.float32)


class MeshCarrier(Carrier):
    """A mesh, by the field's modifier."""

    def read(self, context, item):
        refuse(motion.refusal(item))
        with modifier_stack.evaluated_mesh(context, item, in_place=True) as mesh:
            return mesh_arrays.positions(mesh)

    def bind(self, context, item, entry):
        motion.bind(context, item)

    def write(self, item, entry, shape):
        motion.write(item, motion.Motion(shape - self.points.astype(np.float32)))

    def present(self, item, entry):
        moved = motion.snapshot(item)
        return None if moved is None or moved.offsets is None else self.points + moved.offsets

    def snapshot(self, item, entry):
        return motion.snapshot(item)

    def restore(self, item, entry, before):
        motion.restore(item, before)

    @staticmethod
    def release(item, entry):
        motion.remove(item)
