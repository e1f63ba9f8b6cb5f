# SPDX-License-Identifier: GPL-3.0-or-later
"""Positions of the field's surface after a later Subdivision Surface modifier."""

import math

import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.evaluation import updated
from ..blender.object_references import settings_of
from ..blender.vertex_groups import NearestVertices

MOST = 20000  # limit of vertices for subdivision


def read(context, source, in_place, below, into=np.asarray):
    """((m, 3) places on the surface at the field's place, (m, 3) where they are seen), in local coordinates
    or `into` others; None where no box could need them. `below` are the modifiers that make that surface."""
    own = modifier_stack.find(source) or modifier_stack.find_cache(source)
    behind = list(source.modifiers)[modifier_stack.place(source) :] if in_place else []
    shown = [m for m in behind if m != own and m.type == "SUBSURF" and m.show_viewport and m.levels]
    shown = [modifier for modifier in shown if modifier.subdivision_type == "CATMULL_CLARK"]
    boxes = any(entry.kind == "CUBE" for entry in settings_of(source).handles)
    if not shown or not boxes:
        return None
    kept = [*below, shown[0]]
    with modifier_stack.staged(context, source, kept) as (copied, layer):
        fine, both = copied.modifiers[shown[0].name], []
        room = math.log(MOST / max(1, len(source.data.loops)), 4)  # the first level makes a quad of a corner
        fine.levels = min(fine.levels, max(1, 1 + int(room)))
        for kind in ("SIMPLE", "CATMULL_CLARK"):
            fine.subdivision_type = kind
            seen = copied.evaluated_get(updated(layer))
            both.append(into(mesh_arrays.positions(seen.to_mesh())))
            seen.to_mesh_clear()
    return tuple(both)


def inside(handle, points, shown):
    """(indices of the (p, 3) points that a box holds, whether it holds them by where they are): those inside
    it; where none is, those that are seen inside it, by both arrays of read(), if any."""
    held = np.flatnonzero(handle.inside(points))
    if len(held) or shown is None:
        return held, True
    places, seen = shown
    near = NearestVertices(places, points)
    shifts = np.stack([near.blend(column) for column in (seen - places).T], axis=1)
    held = np.flatnonzero(handle.inside(points + shifts))
    return held, not len(held)
