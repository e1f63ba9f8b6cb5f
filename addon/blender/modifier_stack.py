# SPDX-License-Identifier: GPL-3.0-or-later
"""The place of the field's modifier in an object's stack, and the object's shape there.

The shape is that of a copy whose stack is cut, in a scene of its own: nothing of the user's is switched.
"""

from contextlib import contextmanager

import bpy

from ..core.errors import UserError
from ..names import FIELD_GROUP, LAYER_GROUP
from .evaluation import is_disabled, updated
from .object_references import settings_of
from .removal import remove_modifier
from .splat_layouts import holds_splats

STAGE = "arapfields_stage"  # custom property of the scene that holds the copy
TIME = ("fps", "fps_base", "frame_map_old", "frame_map_new")  # what tells a scene's time by its frame
FREE_NORMALS = "custom_normal"  # attribute of custom normals; free ones are vectors, Blender 4.5 and later
# What a new field modifier comes before, at the end of a stack: it refines the shape and follows it.
REFINING = {"SUBSURF", "MULTIRES", "BEVEL", "SOLIDIFY", "EDGE_SPLIT", "WEIGHTED_NORMAL", "NORMAL_EDIT"}
REFINING |= {"TRIANGULATE", "WIREFRAME"}
# Modifiers before which Blender allows those alone that do nothing but deform, as nodes may do more.
ORIGINAL = {"MULTIRES", "SOFT_BODY"}
# Modifiers that keep every vertex and its number.
KEEPING = {"ARMATURE", "CAST", "CLOTH", "COLLISION", "CORRECTIVE_SMOOTH", "CURVE", "DATA_TRANSFER"}
KEEPING |= {"DISPLACE", "HOOK", "LAPLACIANDEFORM", "LAPLACIANSMOOTH", "LATTICE", "MESH_CACHE", "MESH_DEFORM"}
KEEPING |= {"NORMAL_EDIT", "SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH", "SOFT_BODY", "SURFACE_DEFORM"}
KEEPING |= {"UV_PROJECT", "UV_WARP", "VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY"}
KEEPING |= {"WARP", "WAVE", "WEIGHTED_NORMAL"}


def find(source):
    """The object's field modifier, or None."""
    return next((modifier for modifier in source.modifiers if is_field(modifier)), None)


def find_cache(source):
    """The modifier that plays the object's bake, or None."""
    return next((modifier for modifier in source.modifiers if is_cache(modifier)), None)


def is_cache(modifier):
    return modifier.type == "MESH_CACHE" and modifier.persistent_uid == settings_of(modifier.id_data).bake.uid


def is_field(modifier):
    return modifier.type == "NODES" and modifier.node_group is not None and FIELD_GROUP in modifier.node_group


def layers(source):
    """The modifiers of results below the field's, the first one first."""
    return [modifier for modifier in source.modifiers if is_layer(modifier)]


def is_layer(modifier):
    return modifier.type == "NODES" and modifier.node_group is not None and LAYER_GROUP in modifier.node_group


def top(source):
    """The object's field modifier, or where there is none its last layer, or None."""
    return find(source) or next(reversed(layers(source)), None)


def place(source):
    """Where the field modifier is in the stack, or would come: at the cache that plays in its place, else
    before what only refines the shape, or before the armatures where its rest shape is worked on."""
    stack = list(source.modifiers)
    own = next((index for index, one in enumerate(stack) if is_field(one) or is_cache(one)), None)
    if own is not None:
        return own
    if holds_splats(source):  # what comes after draws them
        return 0
    last = first_posing(source) if settings_of(source).under_rig else end(stack)
    return max(min(last, first_laid_on(source)), earliest(stack))


def end(stack):
    """Where a modifier comes that deforms what those of a stack make, before those that only refine it."""
    index, least = len(stack), earliest(stack)
    while index > least and (
        stack[index - 1].type in REFINING or getattr(stack[index - 1], "use_pin_to_last", False)
    ):
        index -= 1
    return index


def first_posing(source):
    """Where the first modifier stands that poses a source's shape; the stack's length without one."""
    stack = list(source.modifiers)
    return next((index for index, one in enumerate(stack) if is_posing(source, one)), len(stack))


def first_laid_on(source):
    """Where the first modifier stands that lays an object on what the field moves as well, the object that
    carries it or another one that this carries; the stack's length without one."""
    stack, carrier = list(source.modifiers), settings_of(source).carried_by
    moved = [] if carrier is None else [carrier, *(one.item for one in settings_of(carrier).carried)]
    laid = (i for i, one in enumerate(stack) if one.type == "SHRINKWRAP" and one.target in moved)
    return next(laid, len(stack))


def earliest(stack):
    """Where nodes can come first in a stack."""
    return max((index + 1 for index, one in enumerate(stack) if one.type in ORIGINAL), default=0)


def before(source, in_place):
    """The modifiers that make the shape to work on: those before the place, else all but ours.

    Without the armatures whose bones are handles: the field does what they would do.
    """
    stack, rigs = list(source.modifiers), handle_rigs(source)
    kept = stack[: place(source)] if in_place else [m for m in stack if not (is_field(m) or is_cache(m))]
    return [modifier for modifier in kept if not is_replaced(modifier, rigs)]


def handle_rigs(source):
    """The armatures whose bones are handles of an object, or of the one that carries it."""
    owners = [source, settings_of(source).carried_by]
    entries = [entry for owner in owners if owner is not None for entry in settings_of(owner).handles]
    return [entry.rig for entry in entries if entry.kind == "BONE" and entry.rig is not None]


def is_replaced(modifier, rigs):
    """Whether a modifier poses by one of these armatures."""
    return modifier.type == "ARMATURE" and modifier.object in rigs


def is_posing(source, modifier):
    """Whether an armature poses the object by this modifier, rather than the field by its bones."""
    return (
        modifier.type == "ARMATURE"
        and modifier.object is not None
        and not is_replaced(modifier, handle_rigs(source))
    )


def shown_before(source, in_place):
    return [modifier for modifier in before(source, in_place) if modifier.show_viewport]


def behind(source):
    """The modifiers that act on what the field has moved."""
    return [one for one in list(source.modifiers)[place(source) :] if not (is_field(one) or is_cache(one))]


def keeps_vertices(source):
    """Whether the vertices at the field's place are those of the mesh, by number, shown and rendered."""
    return all(
        modifier.type in KEEPING or is_layer(modifier)
        for modifier in before(source, in_place=True)
        if modifier.show_viewport or modifier.show_render
    )


def is_stage(scene):
    return STAGE in scene


@contextmanager
def evaluated(context, source, kept, frame=None):
    """(object, depsgraph) of the object with these of its modifiers alone, for as long as the block runs;
    at a frame other than that at hand where one is given."""
    is_whole = all(modifier in kept for modifier in source.modifiers if modifier.show_viewport)
    if is_whole and not is_disabled(source) and frame is None:
        depsgraph = updated(context.view_layer)
        yield source.evaluated_get(depsgraph), depsgraph
        return
    with staged(context, source, kept, frame) as (copied, layer):
        depsgraph = updated(layer)
        yield copied.evaluated_get(depsgraph), depsgraph


@contextmanager
def staged(context, source, kept, frame=None):
    """(copy, view layer) of the object with these of its modifiers alone, in a scene of its own."""
    stage = bpy.data.scenes.new("ARAP Fields")
    copied = None
    try:
        stage[STAGE] = True
        stage.frame_current, stage.frame_subframe = context.scene.frame_current, context.scene.frame_subframe
        for name in TIME:
            setattr(stage.render, name, getattr(context.scene.render, name))
        layer = stage.view_layers[0]
        updated(layer)  # the frame is set before there is anything to animate
        copied = cut_copy(source, {modifier.name for modifier in kept})
        stage.collection.objects.link(copied)
        if frame is not None:
            updated(layer)
            stage.frame_current, stage.frame_subframe = frame, 0.0
        yield copied, layer
    finally:
        if copied is not None:
            bpy.data.objects.remove(copied)
        bpy.data.scenes.remove(stage)


def cut_copy(source, kept):
    """A copy of the object, which shares its mesh, with these of its modifiers alone."""
    copied = source.copy()
    copied.hide_viewport = False
    for modifier in list(copied.modifiers):
        if modifier.name not in kept:
            remove_modifier(modifier)
    return copied


@contextmanager
def evaluated_mesh(context, source, in_place=False, frame=None):
    """The mesh that is worked on, for as long as the block runs."""
    with mesh_of(context, source, before(source, in_place), frame) as mesh:
        yield mesh


@contextmanager
def moved_mesh(context, source):
    """The mesh just after the field's modifier, for as long as the block runs."""
    with mesh_of(context, source, list(source.modifiers)[: place(source) + 1]) as mesh:
        yield mesh


@contextmanager
def mesh_of(context, source, kept, frame=None):
    """The mesh or point cloud as these of its modifiers make it, for as long as the block runs."""
    with evaluated(context, source, kept, frame) as (item, depsgraph):
        if source.type == "POINTCLOUD":
            yield item.data
            return
        mesh = item.to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph)
        if mesh is None:
            raise UserError("{name}: Blender gives no mesh for it", source)
        try:
            yield mesh
        finally:
            item.to_mesh_clear()


def mesh_copy(context, source, in_place=False):
    """A mesh of its own of the shape that is worked on."""
    with evaluated(context, source, before(source, in_place)) as (item, depsgraph):
        return bpy.data.meshes.new_from_object(item, preserve_all_data_layers=True, depsgraph=depsgraph)


def free_normals(mesh):
    """The domain of free custom normals (POINT, FACE or CORNER), or "" where normals turn by themselves."""
    normals = mesh.attributes.get(FREE_NORMALS)
    return normals.domain if normals is not None and normals.data_type == "FLOAT_VECTOR" else ""
