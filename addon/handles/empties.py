# SPDX-License-Identifier: GPL-3.0-or-later
"""Empties of handles: made, named, found, chosen in the list, scaled, and deleted."""

import re

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..blender import former_defaults, mesh_arrays, modifier_stack, vertex_groups
from ..blender.evaluation import is_driven
from ..blender.language import translated
from ..blender.object_references import choose_row, in_scene, owner_of, refusal_of_linked, settings_of
from ..blender.point_data import selection_of
from ..blender.property_definitions import from_single_precision
from ..blender.references import takes_references
from ..core.errors import UserError, refuse
from ..core.geometry.handles import far_handle, solve_handle
from ..core.geometry.spaces import Space, inverse, space_of, transform
from ..core.runtime.jobs import run_to_completion
from ..names import HANDLES, HANDLES_MARK
from . import movers, symmetry
from .movers import box_now, current_box, has_mover, matrix_of, name_of

# Empties of handles: made, named, found, chosen in the list, and deleted.

# Names and colours of handles.

# Names of handles, by the vertex group that they hold, such as "head", else "Handle 3".

RIG_PREFIX = re.compile(r"^(DEF|ORG|MCH)-")  # prefixes of bones in generated rigs
BLENDERS_OWN = re.compile(r"(\.\d{3,})?$")  # suffix that Blender appends to a used name


def name_for(obj, point_world, kind) -> str:
    """A name for a handle of `obj` at a point: its strongest vertex group there, else its kind and a number.

    `obj` is the mesh object, `point_world` (3,) in world space, `kind` CUBE, POINT, GROUP or PIN.
    """
    group = group_at(obj, point_world) if obj.vertex_groups else ""
    return name_of_group(group) or numbered(obj, kind)


def name_of_group(group):
    """A vertex group's name without a rig's prefix."""
    return RIG_PREFIX.sub("", group)


def group_at(obj, point_world):
    """The vertex group with the largest weight at the vertex nearest to a world location; "" for none."""
    try:
        with modifier_stack.evaluated_mesh(bpy.context, obj, settings_of(obj).in_place) as mesh:
            index = nearest(mesh, obj, point_world)
            weights = [] if index is None else [(e.weight, e.group) for e in mesh.vertices[index].groups]
    except UserError:  # no mesh to read
        return ""
    weights = [entry for entry in weights if entry[0] > 0]
    return obj.vertex_groups[max(weights)[1]].name if weights else ""


def nearest(mesh, obj, point_world):
    """Index of the vertex nearest to a world location; None without vertices."""
    points = mesh_arrays.positions(mesh)
    if not len(points):
        return None
    matrix = np.array(obj.matrix_world, dtype=np.float64)
    return int(np.linalg.norm(points @ matrix[:3, :3].T + matrix[:3, 3] - point_world, axis=1).argmin())


def numbered(obj, kind):
    """ "Handle 3" for the third handle of the object, or the next number that no object has."""
    word = translated("Pin") if kind == "PIN" else translated("Handle")
    number = len(settings_of(obj).handles) + 1
    while f"{word} {number}" in bpy.data.objects:
        number += 1
    return f"{word} {number}"


def is_blenders_own(empty):
    """Whether Blender named an Empty, rather than the user."""
    plain = BLENDERS_OWN.sub("", empty.name)
    return plain in ("Empty", bpy.app.translations.pgettext_data("Empty"))


# Colours of handles: distinct from each other, from a grey viewport and from Blender's selection orange.

PALETTE = [
    *((0.27, 0.55, 1.0), (1.0, 0.42, 0.30), (0.35, 0.80, 0.40), (0.85, 0.45, 0.90), (1.0, 0.80, 0.25)),
    *((0.62, 0.92, 1.0), (0.55, 0.10, 1.0), (0.77, 0.18, 0.48), (0.62, 1.0, 0.10), (1.0, 0.70, 0.92)),
    *((0.48, 0.48, 0.25), (0.10, 0.77, 0.85), (0.10, 0.62, 0.10), (0.70, 0.62, 0.18), (0.48, 0.40, 0.62)),
    *((0.10, 1.0, 0.77), (1.0, 0.10, 0.70), (0.10, 0.55, 0.62)),
]


def free_colour(handles):
    """The colour that the fewest of these handles have."""
    counts = [sum(is_colour(entry.colour, colour) for entry in handles) for colour in PALETTE]
    return PALETTE[counts.index(min(counts))]


def is_colour(one, other):
    return max(abs(a - b) for a, b in zip(one, other, strict=True)) < 1e-3


# Makes a handle's row active when its Empty becomes active; blender/object_references.py does the reverse.

seen_active = {}  # "active": session_uid of the active object at the last check


def follow_active(context):
    """Checks the active object; called after depsgraph updates."""
    layer = getattr(context, "view_layer", None)
    active = layer.objects.active if layer is not None else None
    uid = active.session_uid if active is not None else None
    if seen_active.get("active") == uid:
        return
    seen_active["active"] = uid
    source = owner_of(active) if active is not None and active.type == "EMPTY" else None
    if source is None or source.library is not None:
        return
    index = find(source, active)
    if index >= 0 and index != settings_of(source).active_handle:
        choose_row(settings_of(source), index)


# Empties as handles: rest boxes are stored in the source's coordinates, targets read from the Empties.


def rest_box(source, entry, where=matrix_of):
    """(4, 4) cube [-1, 1]³ → world, of a handle's rest box, which moves with the source."""
    return where(source) @ movers.rest_of(entry)


def store_rest(source, entry):
    """Stores the present pose of the handle's Empty or bone as its rest pose; UserError for a flat source."""
    space_of(matrix_of(source), source.name)
    entry.rest, entry.unwrapped = movers.box_in_source(entry).ravel(), np.zeros(16)
    entry.frame = bpy.context.scene.frame_current


def used(source):
    """The handles whose Empties or bones still exist."""
    return [entry for entry in settings_of(source).handles if has_mover(entry)]


def listed(source):
    """The handles that the panel lists: also those whose Empties or bones were deleted."""
    return [entry for entry in settings_of(source).handles if not movers.is_copied(entry)]


def chosen_entry(source):
    """The handle in the active row of the list, or None."""
    handles, row = settings_of(source).handles, settings_of(source).active_handle
    return handles[row] if 0 <= row < len(handles) and not movers.is_copied(handles[row]) else None


def lost_bone(source):
    """UserError that names a bone missing in its armature; else None."""
    for entry in settings_of(source).handles:
        if entry.kind == "BONE" and in_scene(entry.rig) and not has_mover(entry):
            names = {"rig": entry.rig.name, "bone": entry.bone}
            return UserError("The armature {rig} has no bone {bone}; take that handle off the list", **names)
    return None


def require_handles(source):
    """UserError that says why a source's handles cannot be followed; else None."""
    reason = lost_bone(source) or movers.frozen(used(source))
    if reason is not None:
        return reason
    if not used(source):
        return UserError("Drag a pin or add a handle first")
    return vertex_groups.missing(source, group_names(source))


def holding_nothing(source):
    """Names of the handles that held no part of the surface when their rest poses were stored."""
    return [name_of(entry) for entry in used(source) if entry.inside == 0]


def find(source, empty):
    """Index of the Empty's handle in the source's list, or -1."""
    handles = settings_of(source).handles
    return next((index for index, entry in enumerate(handles) if entry.empty == empty), -1)


def group_names(source):
    """The vertex groups that the source's handles use."""
    return [movers.group_of(e) for e in used(source) if e.kind == "GROUP" or (e.kind == "BONE" and e.group)]


def solve_handles(source, space, weights=None, where=matrix_of, rendered=None):
    """All handles of a source for the solver; UserError without any.

    `weights`: of the vertex groups, by name; without them, the handles have targets only.
    `where(object, bone)`: the world matrix of an object or of its pose bone. `rendered`: the depsgraph of a
    render that it reads.
    """
    refuse(lost_bone(source))
    handles = []
    for entry in used(source):
        if movers.is_child(entry):
            at, stretch = Space(space.local_to_solve, np.eye(4)), space.local_to_solve
            world, now = stretch, stretch @ movers.box_in_source(entry, where, rendered)
        else:
            at, world, now = space, where(source), box_now(entry, where)
        group = movers.group_of(entry) if entry.kind in ("GROUP", "BONE") else ""
        held = weights[group] if weights and group else None
        options = {"weights": held, "weight": entry.weight, "hold_from": entry.hold_from}
        options["reach"] = from_single_precision(entry.reach)
        options["allow_scale"] = entry.allow_scale and entry.kind != "POINT"
        handles.append(
            solve_handle(name_of(entry), entry.kind, movers.rest_of(entry), world, now, at, **options)
        )
    if not handles:
        raise UserError("{name} has no handle; add one in the panel's Handles section", source)
    centers, beyond = kept_rest(source)
    if not len(centers):
        return handles
    centers = transform(space.local_to_solve, np.array(centers))
    mirror = symmetry.mirror_of(source)
    if mirror is not None:
        across = space.world_to_solve @ mirror @ space.solve_to_world
        centers = np.concatenate([centers, transform(across, centers)])
    return [*handles, far_handle(centers, from_single_precision(beyond))]


def kept_rest(source):
    """(pin centers in the source's coordinates, distance): points farther from all centers stay in place.

    No centers, and no such points, where Locality keeps the rest, if there are handles other than pins, or
    only anchors. Distance 0 is the rule of earlier files: half of the distance to the farthest point, if
    there is no anchor.
    """
    settings, entries = settings_of(source), used(source)
    pins = all(entry.kind in PINS for entry in entries)
    lacks_locality = settings.contact.use or settings.secondary.use
    instead = lacks_locality and settings.deform.locality > 0 and settings.keep_beyond > 0
    if pins and (settings.keep_rest or instead):
        moving = [tuple(movers.rest_of(e)[:3, 3]) for e in entries if not e.anchor]
        return tuple(moving), settings.keep_beyond
    if settings.hold_far and pins and not any(e.anchor for e in entries):
        return tuple(tuple(movers.rest_of(e)[:3, 3]) for e in entries), 0.0
    return (), 0.0


PINS = ("PIN", "POINT")  # these hold location and rotation, and location only
SHAPES = {"CUBE": "CUBE", "POINT": "SPHERE", "GROUP": "ARROWS", "PIN": "SPHERE"}


def require_fit(source, empty):
    """Raises UserError if an Empty cannot be a handle of the source."""
    if empty.empty_display_type == "IMAGE":
        raise UserError("{name} shows an image; take another kind of Empty", empty)
    if abs(np.linalg.det(current_box(empty)[:3, :3])) == 0:
        raise UserError("{name} is flat; give it a size and a scale other than zero", empty)
    if owner_of(empty) not in (None, source):  # a handle of this file is taken over
        refuse(refusal_of_linked(empty))


def add(source, empty, kind="CUBE"):
    """Makes an Empty a handle of the source, with its present pose as rest pose; resets an existing one."""
    require_fit(source, empty)
    space_of(matrix_of(source), source.name)
    settings = settings_of(source)
    owner = settings_of(empty).handle_of
    if owner is not None and owner != source and find(owner, empty) >= 0:  # a duplicate of a handle is none
        remove(owner, find(owner, empty))
    entry = choose_or_add(settings, find(source, empty))
    entry.empty, entry.kind, entry.rig, entry.bone = empty, kind, None, ""
    if takes_references(empty):
        settings_of(empty).handle_of = source
        empty.empty_display_type = SHAPES[kind]
        if empty.parent is None and not is_driven(empty):
            movers.attach(empty, source)
    store_rest(source, entry)
    return entry


def choose_or_add(settings, index):
    """The handle in that row, or a new one for -1; makes its row active."""
    if index < 0:
        if not settings.handles:
            former_defaults.begin(settings)
        index, colour = len(settings.handles), free_colour(settings.handles)
        settings.handles.add().colour = colour
    choose_row(settings, index)
    return settings.handles[index]


def make_empty(context, source, matrix, size, name):
    """A new cube Empty, a child of the source, in the collection of handles beside it."""
    empty = bpy.data.objects.new(name, None)
    empty.empty_display_type, empty.empty_display_size = "CUBE", size
    home_of(context, source).objects.link(empty)
    empty.matrix_basis = matrix
    movers.attach(empty, source)
    context.view_layer.update()
    return empty


def home_of(context, source):
    """The collection of handles within that of the source; made if there is none."""
    around = next((c for c in source.users_collection if c in editable(context)), context.collection)
    if not takes_references(around):
        around = context.scene.collection
    home = next((one for one in around.children if one.get(HANDLES_MARK) and one.library is None), None)
    if home is None:
        home = bpy.data.collections.new(HANDLES)
        home[HANDLES_MARK] = True
        around.children.link(home)
    return home


def delete(empty):
    """Deletes an Empty, and with the last one the collection of handles."""
    homes = [one for one in empty.users_collection if one.get(HANDLES_MARK)]
    bpy.data.objects.remove(empty)
    for home in homes:
        if not home.all_objects and not home.children and home.library is None:
            bpy.data.collections.remove(home)


def editable(context):
    return [context.scene.collection, *context.scene.collection.children_recursive]


def can_place(source, kind, place):
    """Whether the source has vertex groups, or a selection, for such a new handle; a quick check."""
    if source is None or (kind == "GROUP" and not source.vertex_groups):
        return False
    return place != "SELECTION" or source.mode != "EDIT" or getattr(source.data, "total_vert_sel", 1) > 0


def new_empty(context, source, kind, group, place):
    """A new Empty: about the selected vertices, in the middle of the vertex group, or at the 3D cursor."""
    corners = transform(matrix_of(source), np.array(source.bound_box))
    size = float(np.ptp(corners, axis=0).max()) / 6 or 1.0
    if place == "SELECTION":
        matrix = Matrix(selection_box(source, size).tolist())
        name = name_for(source, matrix.translation, kind)
        return make_empty(context, source, matrix, 1.0, name)
    where = context.scene.cursor.location
    if kind == "GROUP":
        in_place = settings_of(source).in_place
        weights = run_to_completion(vertex_groups.read_weights(context, source, [group], in_place))[group]
        with modifier_stack.evaluated_mesh(context, source, in_place) as mesh:
            middle = np.average(mesh_arrays.positions(mesh), axis=0, weights=weights)
        where = source.matrix_world @ Vector(middle)
    name = name_of_group(group) if kind == "GROUP" else name_for(source, where, kind)
    return make_empty(context, source, Matrix.Translation(where), size, name)


def selection_box(source, size):
    """(4, 4) cube [-1, 1]³ → world, of the box along the source's axes around its selected vertices."""
    if source.mode == "EDIT":
        source.update_from_editmode()
    mesh = source.data
    chosen = selection_of(mesh)
    if not chosen.any():
        raise UserError("{name} has no selected vertices", source)
    points = mesh_arrays.positions(mesh)[chosen]
    low, high = points.min(axis=0), points.max(axis=0)
    world = matrix_of(source)
    scales = np.linalg.norm(world[:3, :3], axis=0)
    least = 0.1 * size / np.where(scales > 0, scales, 1.0)  # a single vertex still makes a box
    box = np.eye(4)
    box[:3, :3] = np.diag(np.maximum(1.05 * (high - low) / 2, least))
    box[:3, 3] = (low + high) / 2
    return world @ box


def mirror(context, source, entry, axis):
    """Adds a handle mirrored across the plane where the source's axis (0, 1 or 2) is 0."""
    flip = np.eye(4)
    flip[axis, axis] = -1.0
    world = matrix_of(source)
    group = bpy.utils.flip_name(entry.group) if entry.kind == "GROUP" else ""
    if group and group not in source.vertex_groups:
        raise UserError("{name} has no vertex group {group}", source, group=group)
    rest = flip @ movers.rest_of(entry) @ flip
    current = flip @ inverse(world) @ matrix_of(entry.empty) @ flip
    name, size = entry.empty.name, entry.empty.empty_display_size
    flipped = bpy.utils.flip_name(name)
    kept, kind = movers.user_settings(entry), entry.kind
    new_name = flipped if flipped != name else f"{name}_mirrored"
    empty = make_empty(context, source, Matrix((world @ current).tolist()), size, new_name)
    mirrored = add(source, empty, kind)
    mirrored.rest, mirrored.group = rest.ravel(), group
    movers.put_user_settings(mirrored, kept)
    return mirrored


def reset(source, entry):
    """Moves a handle's Empty back to its rest pose."""
    size = entry.empty.empty_display_size or 1.0
    matrix = rest_box(source, entry) @ np.diag([1 / size, 1 / size, 1 / size, 1.0])
    entry.empty.matrix_world = Matrix(matrix.tolist())


def remove(source, index):
    """Removes a handle from the source's list; its Empty stays as an ordinary one."""
    settings = settings_of(source)
    empty = settings.handles[index].empty
    if empty is not None and settings_of(empty).handle_of == source:
        settings_of(empty).handle_of = None
    settings.handles.remove(index)
    choose_row(settings, max(0, min(settings.active_handle, len(settings.handles) - 1)))


# Handles that are scaled without Allow Scale.

LEAST_SCALE = 1e-3  # relative difference from the rest size above which a box counts as scaled


def ignored_scale(source):
    """UserError that names the handles whose scale is ignored; else None."""
    names = [movers.name_of(entry) for entry in used(source) if is_scale_ignored(source, entry)]
    if not names:
        return None
    return UserError("{names} is scaled, which counts only with Allow Scale", names=", ".join(names))


def is_scale_ignored(source, entry):
    if entry.allow_scale or entry.kind == "POINT":
        return False
    rest, now = rest_box(source, entry)[:3, :3], movers.box_now(entry)[:3, :3]
    if not np.isfinite(now).all() or abs(np.linalg.det(rest)) == 0.0:
        return False  # refused elsewhere
    stretches = np.linalg.svd(now @ np.linalg.inv(rest), compute_uv=False)
    return bool(np.abs(stretches - 1.0).max() > LEAST_SCALE)
