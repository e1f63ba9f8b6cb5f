# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers of fields on one object: their order, and modifiers that are off, doubled or left behind."""

import contextlib
from itertools import count
from typing import NamedTuple

import numpy as np

from ..blender import mesh_arrays, modifier_stack, references
from ..blender.evaluation import varies
from ..blender.language import translated
from ..blender.object_references import settings_of
from ..blender.references import takes_references
from ..blender.splat_layouts import holds_splats
from ..core.errors import UserError
from ..core.runtime import jobs
from ..names import FIELD_MODIFIER, LAYER_GROUP
from . import cache_modifier, motion, node_group

# Checks whether the user has disabled the field's modifier, or something does not follow it.


def reasons_unseen(source):
    """[UserError] if the field's modifier is off or its Factor 0, and neither is animated; and if modifiers
    before it, such as hair, use the surface that is not moved yet."""
    modifier = modifier_stack.find(source)
    return [] if modifier is None else modifier_off(source, modifier) + unmoved_modifiers(source)


def unmoved_modifiers(source):
    left = modifier_stack.left_behind(source)
    if not left:
        return []
    names = ", ".join(one.name for one in left)
    return [
        UserError(
            "{name}: {modifiers} stays where the surface was; move it behind the field's modifier",
            source,
            modifiers=names,
        )
    ]


def modifier_off(source, modifier):
    if modifier.show_viewport and node_group.get(modifier, "Factor") != 0.0:
        return []
    if varies(source, f'modifiers["{modifier.name}"]'):
        return []
    return [
        UserError("The modifier {modifier} of {name} is off, or its Factor 0", source, modifier=modifier.name)
    ]


# Disables duplicates of the field's modifier in one stack, which would double the motion.


def switch_copies_off(source):
    """Disables all but the first field modifier of an object."""
    for modifier in [m for m in source.modifiers if modifier_stack.is_field(m)][1:]:
        if modifier.show_viewport or modifier.show_render:
            modifier.show_viewport = modifier.show_render = False
            text = translated("{name} is a second copy and was switched off", name=modifier.name)
            jobs.add_message("WARNING", f"{source.name}: {text}", {source.session_uid})


# Layers: earlier results that later ones act on, a style on a wrap, a deformation on both.
#
# A layer is a former field modifier. It keeps its place, its Factor and its motion, in attributes of its
# own. When the field's modifier is removed, the last layer becomes the field's modifier again.

ORDER = {"WRAP": 0, "STYLIZE": 1, "DEFORM": 2}  # each acts on the results of lower ones
STAYING = {"WRAP": "Wrap", "STYLIZE": "Stylize"}  # {kind that can become a layer: its label}
POSED = "POSED"  # kind of a style with handles: a deformation on it would move them twice


def note(source, kind):
    """Stores the kind of a source's motion: POSED for a style with handles, or ""."""
    settings = settings_of(source)
    if kind == "STYLIZE" and settings.stylize.use_handles and settings.handles:
        kind = POSED
    if settings.moved_by != kind:  # any write tags the object as updated
        settings.moved_by = kind


def can_stay(source):
    """Whether the field's modifier of a source can become a layer."""
    settings, field = settings_of(source), modifier_stack.find(source)
    if field is None or settings.moved_by not in STAYING or source.mode == "EDIT" or source.library:
        return False
    return is_alone(source) and field.show_viewport and not cache_modifier.is_playing(source)


def is_alone(source):
    """Whether nothing of a source keeps its results from being layers."""
    settings = settings_of(source)
    return not (settings.carried or settings.carried_by or settings.field_helper or holds_splats(source))


def stays_below(source, kind):
    """Whether a run of that kind acts on the field's present result."""
    return can_stay(source) and ORDER[settings_of(source).moved_by] < ORDER[kind]


def below_pose(source, in_place):
    """The modifiers that make the shape that a deformation acts on."""
    field = [modifier_stack.find(source)] if in_place and stays_below(source, "DEFORM") else []
    return [*modifier_stack.before(source, in_place), *field]


def replaced(source, kind):
    """UserError that says which result a run of that kind replaces; None if that is of the same kind, or
    becomes a layer."""
    by = settings_of(source).moved_by.replace(POSED, "STYLIZE")
    if modifier_stack.find(source) is None or by in ("", kind) or stays_below(source, kind):
        return None
    if by == "DEFORM" and is_alone(source):
        return UserError("{name}: this takes the pose off; press Pose afterwards to have it again", source)
    operation = {"DEFORM": "Deform", **STAYING}[by]
    return UserError("{name}: this replaces the result of {operation}", source, operation=operation)


class Way(NamedTuple):
    """What make_way() has changed."""

    is_covered: bool = False  # the field's modifier has become a layer
    gone: tuple = ()  # (motion, kind, Factor) of each that was removed, None where a layer had none above


NOTHING = Way()


def make_way(source, kind):
    """Called before a run reads its shape: makes the result that it acts on a layer, or removes those above.
    Those of a linked object stay. Returns the Way, for put_back() if the run fails."""
    gone = []
    if not takes_references(source):
        return NOTHING
    if stays_below(source, kind):
        cover(source)
        return Way(is_covered=True)
    for layer in reversed(modifier_stack.layers(source)):
        if ORDER[kind_in(layer)] < ORDER[kind]:
            break
        field, by = modifier_stack.find(source), settings_of(source).moved_by
        gone.append(field and (motion.snapshot(source), by, node_group.get(field, "Factor")))
        with references.unused_kept():  # put_back() may take them again, without a step of undo
            motion.discard(source)
            uncover(source, baked=True)
    return Way(gone=tuple(gone))


@contextlib.contextmanager
def way_for_handle(context, source):
    """Context manager: make_way() for a new handle, which holds the visible shape; put back after an error.
    Not while a session is live."""
    before = references.referred([source])
    way = NOTHING if settings_of(source).live_kind else make_way(source, "DEFORM")
    try:
        yield
    except Exception:
        put_back(context, source, way)
        references.push_new("Handle", [source], before)
        raise


def put_back(context, source, way):
    """Restores layers and the motion on top of them after a run that failed, and a bake that played."""
    playing = cache_modifier.suspend(source)
    for one in reversed(way.gone):
        if not can_stay(source):
            break
        cover(source)
        if one is not None:
            moved, by, factor = one
            with contextlib.suppress(UserError):  # the mesh has changed
                node_group.put(motion.bind(context, source), "Factor", factor)
                if moved.offsets is not None:  # an undo may have emptied what held them
                    motion.write(source, moved)
                settings_of(source).moved_by = by
    if way.is_covered:
        uncover(source, baked=True)
    if playing:
        cache_modifier.set_playing(source, True)


def carrying(source, kind):
    """The modifier with a source's result of that kind, or None."""
    if (
        modifier_stack.find(source) is not None
        and settings_of(source).moved_by.replace(POSED, "STYLIZE") == kind
    ):
        return modifier_stack.find(source)
    return next((layer for layer in modifier_stack.layers(source) if kind_in(layer) == kind), None)


def offset_at(source, index):
    """(3,) how far the results that are shown move a source's vertex, in local coordinates."""
    moved = np.zeros(3)
    for modifier in filter(None, [*modifier_stack.layers(source), modifier_stack.find(source)]):
        number = "" if modifier_stack.is_field(modifier) else parts(modifier)[1]
        offsets = motion.carrier(source, modifier).attributes.get(node_group.names_of(number)[0])
        if modifier.show_viewport and offsets is not None and index < len(offsets.data):
            moved += node_group.get(modifier, "Factor") * np.array(offsets.data[index].vector)
    return moved


def parts(layer):
    """(kind, number, domain of free normals or "") of a layer."""
    _, kind, number, *normals = layer.node_group[LAYER_GROUP].split()
    return kind, number, "".join(normals)


def kind_in(layer):
    return parts(layer)[0]


def cover(source):
    """Turns the field's modifier into the last layer."""
    settings, field = settings_of(source), modifier_stack.find(source)
    mesh, kind, normals = motion.carrier(source, field), settings.moved_by, node_group.normals_of(field)
    taken = {int(parts(layer)[1]) for layer in modifier_stack.layers(source)}
    number = next(n for n in count(1) if n not in taken and node_group.names_of(n)[0] not in mesh.attributes)
    motion.written.add(source.session_uid)
    motion.write_to(mesh, motion.read_from(mesh), number)
    if mesh != source.data or mesh.users == 1:
        motion.write_to(mesh, motion.Motion(None))
    with references.unused_kept():  # uncover() may take its group again, without a step of undo
        motion.take_group(field, node_group.find_or_make_layer(kind, number, normals))
    rename(field, FIELD_MODIFIER, f"{FIELD_MODIFIER} {STAYING[kind]}")
    settings.under_rig, settings.moved_by = False, ""


def uncover(source, baked=False):
    """Turns the last layer into the field's modifier, unless there is one, or a bake's modifier and not
    `baked`; returns whether it has."""
    layers = modifier_stack.layers(source)
    owned = modifier_stack.find(source) or (None if baked else modifier_stack.find_cache(source))
    if not layers or owned is not None or source.mode == "EDIT" or not takes_references(source):
        return False
    layer = layers[-1]
    kind, number, normals = parts(layer)
    mesh = motion.carrier(source, layer)
    motion.written.add(source.session_uid)
    moved = motion.read_from(mesh, number)
    if mesh == source.data and mesh.users > 1:
        helper = motion.take_helper(source, layer)  # other users keep their motion
        mesh_arrays.take_geometry(helper.data, mesh)
        mesh = helper.data
    motion.write_to(mesh, moved)
    motion.write_to(mesh, motion.Motion(None), number)
    motion.take_group(layer, node_group.find_or_make(normals))
    rename(layer, f"{FIELD_MODIFIER} {STAYING[kind]}", FIELD_MODIFIER)
    behind = list(source.modifiers)[list(source.modifiers).index(layer) :]
    settings_of(source).under_rig = kind == "WRAP" and any(one.type == "ARMATURE" for one in behind)
    settings_of(source).moved_by = kind
    return True


def rename(modifier, old, new):
    """Renames a modifier, unless the user has renamed it."""
    if modifier.name == old:
        modifier.name = new


def discard(source):
    """Removes the layers once the mesh contains their motion."""
    for _ in modifier_stack.layers(source):
        uncover(source, baked=True)
        motion.discard(source)
