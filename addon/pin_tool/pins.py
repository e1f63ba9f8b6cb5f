# SPDX-License-Identifier: GPL-3.0-or-later
"""Pins: handles with an Empty on the surface, each of which holds a small round region of it."""

import bpy
import numpy as np
from mathutils import Matrix

from ..blender import modifier_stack, object_references
from ..blender.language import translated
from ..blender.object_references import owner_of, settings_of
from ..blender.property_definitions import listeners
from ..carried import carrying
from ..core.errors import UserError
from ..core.geometry.handles import box_matrix
from ..core.geometry.spaces import inverse
from ..core.runtime import jobs
from ..field_modifier import layers, motion
from ..handles import empties, movers
from ..live import sessions
from ..results import placement
from . import places

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
    for source in context.view_layer.objects:
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
    handles, row = settings_of(active).handles, settings_of(active).active_handle
    if not object_references.is_source(active) or not 0 <= row < len(handles):
        return None
    entry = handles[row]
    is_empty = entry.kind != "BONE" and movers.has_mover(entry)
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
        place = places.find(context, source, location, radius, face, face_count)
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
        jobs.add_message("WARNING", translated(error))


def hold_turn(entry, holds):
    """Switches a pin between holding location and the surface's present rotation, and location only."""
    if entry.kind not in empties.PINS or holds == (entry.kind == "PIN"):
        return
    source, empty = entry.id_data, entry.empty
    if holds:
        location = np.array(empty.matrix_world.translation)
        place = places.find(bpy.context, source, location, empty.empty_display_size)
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
