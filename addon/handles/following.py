# SPDX-License-Identifier: GPL-3.0-or-later
"""Moves Empties of handles with the surface that they hold, when a wrap is applied or removed.

They stay if a deformation would not act on the wrap's result (layers.py).
"""

import numpy as np
from mathutils import Matrix

from ..blender import mesh_arrays, modifier_stack
from ..blender.evaluation import is_driven
from ..blender.object_references import settings_of
from ..core.geometry.handles import followed_box
from ..core.geometry.spaces import inverse, transform
from ..field_modifier import layers
from . import empties, held_counts
from .movers import box_now, matrix_of, rest_of


class Followers:
    """The handles of a source, made before its surface changes."""

    def __init__(self, context, source):
        entries = [entry for entry in empties.used(source) if entry.kind != "BONE"]
        self.before = seen(context, source) if entries else None
        self.is_wrapped = settings_of(source).moved_by == "WRAP"

    def follow(self, context, source, back=False):
        """Moves rest boxes with the surface, and their Empties by the same motion; `back`: to the rest boxes
        from before the wrap."""
        after = None if self.before is None else seen(context, source)
        if after is None or len(after) != len(self.before) or np.array_equal(after, self.before):
            return
        world, moved = matrix_of(source), []
        for entry in empties.used(source):
            if entry.kind == "BONE" or not is_free(entry.empty):
                continue
            rest, now = world @ rest_of(entry), box_now(entry)
            unwrapped = np.array(entry.unwrapped, dtype=np.float64).reshape(4, 4)
            was_taken = self.is_wrapped and unwrapped.any()
            unwrapped = unwrapped if was_taken else rest_of(entry)
            if back and was_taken:
                box = world @ unwrapped
            else:
                box = followed_box(rest, self.before, after, is_box=entry.kind == "CUBE")
            is_at_rest = np.allclose(rest, now, rtol=0, atol=1e-5 * np.abs(rest[:3, :3]).max())
            moved.append((entry, box, is_at_rest, unwrapped))
            motion = box @ inverse(rest) @ np.array(entry.empty.matrix_world, dtype=np.float64)
            entry.empty.matrix_world = Matrix(motion.tolist())
        context.view_layer.update()
        for entry, box, is_at_rest, unwrapped in moved:
            if is_at_rest:
                empties.store_rest(source, entry)
            else:
                entry.rest = (inverse(world) @ box).ravel()
            entry.unwrapped = np.zeros(16) if back else unwrapped.ravel()
        held_counts.count_inside(context, source, at_once=True)


def seen(context, source):
    """(n, 3) world vertices of the shape that a deformation acts on."""
    with modifier_stack.mesh_of(context, source, layers.below_pose(source, in_place=True)) as mesh:
        return transform(matrix_of(source), mesh_arrays.positions(mesh))


def is_free(empty):
    """Whether an Empty can be moved: local and not driven."""
    return empty.library is None and empty.override_library is None and not is_driven(empty)
