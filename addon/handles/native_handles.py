# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles for the native library, and what their boxes hold on a surface that is subdivided later."""

import math

import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.evaluation import updated
from ..blender.object_references import settings_of
from ..blender.vertex_groups import NearestVertices
from ..core.geometry.handles import far_from, require_held

# Positions of the field's surface after a later Subdivision Surface modifier.

MOST = 20000  # limit of vertices for subdivision


def read_subdivided(context, source, in_place, below, into=np.asarray):
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


def points_inside(handle, points, shown):
    """(indices of the (p, 3) points that a box holds, whether it holds them by where they are): those inside
    it; where none is, those that are seen inside it, by both arrays of read_subdivided(), if any."""
    held = np.flatnonzero(handle.inside(points))
    if len(held) or shown is None:
        return held, True
    places, seen = shown
    near = NearestVertices(places, points)
    shifts = np.stack([near.blend(column) for column in (seen - places).T], axis=1)
    held = np.flatnonzero(handle.inside(points + shifts))
    return held, not len(held)


# Converts handles to native ones, with the samples that each holds.

AROUND_POINT = 0.03  # of the size: distance within which a point holds vertices


def native_handles(af, handles, rest, samples, reaches=True):
    """Native handles; UserError that names those without a sample. Runs on the worker.

    `handles`: core.geometry.handles.Handle, `rest`: the source's surface at rest. `reaches`: whether to use
    the handles' reach; a style acts everywhere.
    """
    counts, natives, holding = {}, [], Holding(rest.vertices, samples.points, handles)
    for handle in handles:
        further = {"weight": handle.weight, "reach": handle.reach if reaches else 0.0}
        if handle.kind == "POINT":
            natives.append(af.Point(handle.rest[:3, 3], handle.target[:3, 3], **further))
            continue
        further["allow_scale"] = handle.allow_scale
        if handle.kind in ("GROUP", "BONE"):
            held = holding.of(handle)
            counts[handle.name] = len(held)
            natives.append(region(af, handle, held, further))
        elif handle.kind == "PIN":
            natives.append(
                region(af, handle, handle.pinned(samples.points, rest.vertices, rest.triangles), further)
            )
        elif handle.kind == "FAR":
            held = far_from(handle, samples.points)
            natives += [region(af, handle, held, further)] if len(held) else []
        else:
            held, by_box = points_inside(handle, samples.points, rest.shown)
            counts[handle.name] = len(held)
            box = af.Cuboid(handle.rest, handle.target, **further)
            natives.append(box if by_box else region(af, handle, held, further))
    require_held(counts)
    return natives


def held_points(handles, rest, points):
    """(p,) whether one of the handles holds these points of the surface at rest; what is far from pins is
    free."""
    held, holding = np.zeros(len(points), dtype=bool), Holding(rest.vertices, points, handles)
    around = AROUND_POINT * np.ptp(rest.vertices, axis=0).max()
    for handle in handles:
        if handle.kind == "POINT":
            away = np.linalg.norm(points - handle.rest[:3, 3], axis=1)
            held |= away <= max(around, away.min())
        elif handle.kind in ("GROUP", "BONE"):
            held[holding.of(handle)] = True
        elif handle.kind == "PIN":
            held[handle.pinned(points, rest.vertices, rest.triangles)] = True
        elif handle.kind != "FAR":
            held[points_inside(handle, points, rest.shown)[0]] = True
    return held


class Holding:
    """The (p, 3) surface points that groups and bones hold; their weights are given at `vertices`."""

    def __init__(self, vertices, points, handles):
        self.vertices, self.points, self.handles = vertices, points, handles
        self._at_points = None

    def of(self, handle):
        """Indices of the points that one of the handles holds."""
        if handle.weights is None:
            return handle.about_bone(self.points, self.handles)
        self._at_points = self._at_points or NearestVertices(self.vertices, self.points)
        return handle.by_weight(self._at_points(handle.weights))


def region(af, handle, held, further):
    return af.Region(held.tolist(), handle.rest, handle.target, **further)
