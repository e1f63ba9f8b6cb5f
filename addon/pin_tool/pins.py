# SPDX-License-Identifier: GPL-3.0-or-later
"""Pins: where they are on the surface and what their balls hold, placed, found and discarded."""

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector
from mathutils.geometry import barycentric_transform, closest_point_on_tri

from ..blender import mesh_arrays, modifier_stack, object_references, point_data
from ..blender.language import translated
from ..blender.object_references import owner_of, settings_of
from ..blender.property_definitions import listeners
from ..carried import carrying
from ..core.errors import UserError
from ..core.geometry.edges import connected
from ..core.geometry.handles import box_matrix
from ..core.geometry.spaces import best_rotation, inverse, transform
from ..core.runtime import jobs
from ..field_modifier import layers, motion
from ..handles import empties, movers
from ..handles.empties import matrix_of
from ..live import sessions
from ..results import placement

# Maps a point on the deformed surface to the rest shape, with the surface's rotation there.
#
# The field's modifier only moves points, so that the faces before and after it are the same.

CANDIDATES = 64  # number of triangles to search if the face is unknown
LEAST = 12  # least number of points to measure the rotation
LEAST_OWN = 3  # vertices that tell how a place turns


@dataclass(frozen=True)
class Place:
    rest: np.ndarray  # (3,) in world space, of the shape before the field
    now: np.ndarray  # (3,) in world space, after the field
    turn: np.ndarray  # (3, 3) rotation of the surface there since rest
    size: float  # of the shape at rest, in the object's units
    weights: dict  # {vertex group: mean weight of the points around it}


def find(context, source, location, radius, face=None, face_count=None):
    """The Place at a location on the shown surface, or of the splat nearest to it, (3,) in world space.

    `face` is that of the shown mesh, which has `face_count` of them: where the mesh before the field has as
    many, the place is looked for in that face alone.
    """
    world, rest = matrix_of(source), None
    if modifier_stack.find(source) is not None:
        with modifier_stack.evaluated_mesh(context, source, in_place=True) as still:
            rest = transform(world, mesh_arrays.positions(still))
    with modifier_stack.moved_mesh(context, source) as mesh:
        now = transform(world, mesh_arrays.positions(mesh))
        rest = now if rest is None else rest
        faces = point_data.face_count(mesh)
        if not len(now):
            raise UserError("{name} has no vertices to hold a pin", source)
        if not faces:
            nearest = int(((now - location) ** 2).sum(axis=1).argmin())
            at_rest, moved = rest[nearest], now[nearest]
        else:
            if face is not None and face_count == faces:
                chosen = mesh_arrays.triangles_of(mesh, face)
            else:
                chosen = near(now, mesh_arrays.triangles(mesh), location)
            at_rest, moved = map_back(now, rest, chosen, location)
        about = around(rest, at_rest, radius)
        if faces:
            scale = 1 / max(radius, np.linalg.norm(rest[about] - at_rest, axis=1).max(), 1e-300)
            ball = scale * (rest - at_rest)
            own = connected(ball[about], ball, mesh_arrays.triangles(mesh))
            about = about[own] if own.sum() >= LEAST_OWN else about
        weights = group_weights(source, mesh, about)
    size = float(np.linalg.norm(np.ptp(rest, axis=0)) / np.cbrt(abs(np.linalg.det(world[:3, :3])) or 1.0))
    return Place(at_rest, moved, best_rotation(rest[about], now[about]), size, weights)


def near(points, triangles, location):
    """The CANDIDATES triangles whose centers are nearest to the location."""
    away = ((points[triangles].mean(axis=1) - location) ** 2).sum(axis=1)
    count = min(CANDIDATES, len(away))
    return triangles[np.argpartition(away, count - 1)[:count]]


def map_back(now, rest, triangles, location):
    """((3,) rest position, (3,) position) of the point on these triangles nearest to the location."""
    best, nearest, triangle = np.inf, Vector(location), triangles[0]
    for corners in triangles:
        point = closest_point_on_tri(Vector(location), *(Vector(now[i]) for i in corners))
        away = (point - Vector(location)).length
        if away < best:
            best, nearest, triangle = away, point, corners
    ends = [Vector(now[i]) for i in triangle], [Vector(rest[i]) for i in triangle]
    mapped = np.array(barycentric_transform(nearest, *ends[0], *ends[1]))
    if not np.isfinite(mapped).all():  # a degenerate triangle
        closest = triangle[np.linalg.norm(now[triangle] - nearest, axis=1).argmin()]
        mapped = rest[closest]
    return mapped, np.array(nearest)


def around(rest, place, radius):
    """Indices of the points within the radius, or of the LEAST nearest ones if these are fewer."""
    away = np.linalg.norm(rest - place, axis=1)
    count = max(int((away <= radius).sum()), min(LEAST, len(rest)))
    return np.argpartition(away, count - 1)[:count]


def group_weights(source, mesh, indices):
    """{vertex group: mean weight of these points of the mesh}."""
    names = {group.index: group.name for group in source.vertex_groups}
    sums = dict.fromkeys(names.values(), 0.0)
    for index in indices.tolist() if names else ():
        for entry in mesh.vertices[index].groups:
            if entry.group in names:
                sums[names[entry.group]] += entry.weight / len(indices)
    return sums


# Pins: handles with an Empty on the surface, each of which holds a small round region of it.

REACH_STEP = 1.1  # factor of a handle's reach per step of the mouse wheel
KEPT = 0.3  # distance from the pins beyond which points stay without Locality, as a share of the size
MAJORITY = 0.5  # least mean weight of a vertex group that names a pin


def refusal(item):
    """UserError that says why an object cannot be pinned; else None."""
    error = object_references.refusal(item)
    if error is None and item.library is not None:
        error = UserError("{name} is linked from another file; make it local to give it handles", item)
    if error is None and item.mode != "OBJECT":
        error = UserError("{name} is not in Object Mode", item)
    settings = settings_of(item) if error is None else None
    if settings is not None and not placement.in_place(settings.output, settings.target):
        error = UserError(
            "Pins move {name} itself; choose Original Mesh as its geometry, and store it as no New Object",
            item,
        )
    return error


def is_own(item):
    """Whether an object is a source, and no result of another one."""
    return object_references.is_source(item) and owner_of(item) is None


def handles_in_view(context):
    """[(source, entry)] of the visible handles with Empties of objects of which something is visible."""
    handles = []
    for source in object_references.in_view(context):
        if not settings_of(source).handles or not object_references.is_source(source):
            continue
        if any(shape.visible_get() for shape in placement.source_and_results(source)):
            entries = [entry for entry in empties.used(source) if entry.kind != "BONE"]
            handles += [(source, entry) for entry in entries if entry.empty.visible_get()]
    return handles


def chosen(context):
    """The Empty of the chosen handle: the active object, or the active row of an active source; else None."""
    active = context.view_layer.objects.active
    if active is None or not active.select_get():
        return None
    if active.type == "EMPTY":
        return active if entry_of(active) is not None else None
    entry = empties.chosen_entry(active) if object_references.is_source(active) else None
    is_empty = entry is not None and entry.kind != "BONE" and movers.has_mover(entry)
    return entry.empty if is_empty and entry.empty.visible_get() else None


def entry_of(empty):
    """The Empty's handle, or None."""
    source = owner_of(empty)
    index = -1 if source is None else empties.find(source, empty)
    return settings_of(source).handles[index] if index >= 0 else None


def next_reach(source, entry, steps):
    """A handle's reach after that many steps of the mouse wheel, in the object's units.

    At least the handle's own size; beyond the object's size it is 0, which means unlimited, and one step
    back from there is the object's size.
    """
    size = float(np.linalg.norm(np.ptp(np.array(source.bound_box), axis=0)))
    rest = np.array(entry.rest, dtype=np.float64).reshape(4, 4)
    least = float(np.linalg.norm(rest[:3, :3], axis=0).max())
    reach = (entry.reach or size * REACH_STEP) * REACH_STEP**steps
    return 0.0 if reach > size * 1.001 else max(reach, least)


def place(context, source, location, radius, face=None, face_count=None, anchor=False, kind="PIN"):
    """A pin at a location on the shown surface, (3,) in world space; returns its handle.

    On a deformed surface the pin's rest pose is at that point of the rest shape, so that nothing moves.
    """
    error = refusal(source)
    if error is not None:
        raise error
    is_first = not empties.used(source)
    with layers.way_for_handle(context, source):
        place = find(context, source, location, radius, face, face_count)
    if face is not None and np.linalg.norm(place.now - location) > radius:
        warn_of_moves(source)
    if is_first:
        settings_of(source).keep_beyond = KEPT * place.size
    now, rest = np.eye(4), np.eye(4)
    now[:3, :3], now[:3, 3], rest[:3, 3] = place.turn, place.now, place.rest
    empty = empties.make_empty(context, source, Matrix(now.tolist()), radius, name(source, place.weights))
    entry = empties.add(source, empty, kind)
    entry.rest = (
        movers.box_in_source(entry) @ inverse(box_matrix(now, radius)) @ box_matrix(rest, radius)
    ).ravel()
    entry.anchor = anchor
    choose(context, empty)
    return entry


def warn_of_moves(source):
    """Warns that a modifier after the field moves the clicked surface."""
    later = list(source.modifiers)[modifier_stack.place(source) + 1 :]
    moving = [one for one in later if one.show_viewport and not modifier_stack.follows_field(one)]
    if moving:
        error = UserError(
            "{name}: the modifier {modifier} moves the shape after the field; the pin stands before that",
            source,
            modifier=moving[-1].name,
        )
        jobs.add_message("WARNING", translated(error), {source.session_uid})


def hold_turn(entry, holds):
    """Switches a pin between holding location and the surface's present rotation, and location only."""
    if entry.kind not in empties.PINS or holds == (entry.kind == "PIN"):
        return
    source, empty = entry.id_data, entry.empty
    if holds:
        location = np.array(empty.matrix_world.translation)
        place = find(bpy.context, source, location, empty.empty_display_size)
        empty.matrix_world = Matrix.LocRotScale(
            empty.matrix_world.translation, Matrix(place.turn.tolist()), empty.matrix_world.to_scale()
        )
    entry.kind = "PIN" if holds else "POINT"


listeners["hold_turn"] = hold_turn


def name(source, weights):
    """A pin's name: the vertex group with most weight there, else an unused numbered name."""
    best = max(weights, key=weights.get, default=None)
    if best is not None and weights[best] >= MAJORITY:
        return empties.name_of_group(best)
    return empties.numbered(source, "PIN")


def choose(context, empty):
    """Makes the Empty's row the active one, and its object active and selected, alone unless it was active;
    returns whether that changed anything."""
    layer, source = context.view_layer, owner_of(empty)
    index, is_new = empties.find(source, empty), False
    shown = source if source.visible_get() else empty  # the shape may be another object's
    if layer.objects.active != shown or not shown.select_get():
        object_references.select_alone(context, shown)
        is_new = True
    if settings_of(source).active_handle != index:
        object_references.choose_row(settings_of(source), index)
        is_new = True
    return is_new


def discard(source, empty):
    empties.remove(source, empties.find(source, empty))
    empties.delete(empty)


def remove(context, source, empty):
    """Deletes a handle with its Empty; with the last one, also removes the motion."""
    discard(source, empty)
    left = empties.used(source)
    if left:
        with_empties = [entry for entry in left if entry.kind != "BONE"]
        if with_empties:
            choose(context, with_empties[-1].empty)
        return
    sessions.end(context, source)
    motion.remove(source)
    layers.uncover(source)
    carrying.give_back_all(source)
    source.select_set(True)
    context.view_layer.objects.active = source
