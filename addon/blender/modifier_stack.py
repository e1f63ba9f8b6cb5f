# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of modifiers, the place of the field's in an object's stack, and the object's shape there."""

from contextlib import contextmanager
from dataclasses import dataclass

import bpy

from ..core.errors import UserError
from ..names import FIELD_GROUP, LAYER_GROUP
from .evaluation import is_disabled, updated
from .object_references import settings_of
from .references import remove_modifier
from .splat_layouts import holds_splats

# What each kind of modifier does to a mesh, from which a new field modifier's place follows.
#
# A field acts on the shape that is seen, so it stands behind what makes or moves that shape. It stands
# before what only refines, hides or uses it, so that this follows the moved surface.

MAKES = "makes"  # vertices, from others or from elsewhere
MOVES = "moves"  # vertices
WRITES = "writes"  # other data, by where the vertices are
REFINES = "refines"  # the shape, or its normals
HIDES = "hides"  # a part of it
USES = "uses"  # the surface where it stands in the stack, for something else


@dataclass(frozen=True)
class Kind:
    """`keeps`: every vertex stays, with its index."""

    role: str
    keeps: bool
    why: str

    @property
    def follows_field(self):
        """Whether a new field modifier is put before it."""
        return self.role in (REFINES, HIDES, USES)


def keeping(role, why):
    return Kind(role, True, why)


def changing(role, why):
    return Kind(role, False, why)


UNKNOWN = changing(MAKES, "it may make the shape")
KINDS = {
    # Modify
    "DATA_TRANSFER": keeping(WRITES, "what it takes from another mesh belongs to the places at rest"),
    "MESH_CACHE": keeping(MOVES, "a cache has the shape that the field acts on"),
    "MESH_SEQUENCE_CACHE": changing(MAKES, "a file has the shape, with any number of vertices"),
    "NORMAL_EDIT": keeping(REFINES, "normals are of the moved shape"),
    "WEIGHTED_NORMAL": keeping(REFINES, "normals are of the moved shape"),
    "UV_PROJECT": keeping(WRITES, "textures move with the surface: they are projected at rest"),
    "UV_WARP": keeping(WRITES, "it does not depend on the shape"),
    "VERTEX_WEIGHT_EDIT": keeping(WRITES, "the field's mask may be the group"),
    "VERTEX_WEIGHT_MIX": keeping(WRITES, "the field's mask may be the group"),
    "VERTEX_WEIGHT_PROXIMITY": keeping(WRITES, "the field's mask may be the group"),
    # Generate
    "ARRAY": changing(MAKES, "handles take hold of all copies"),
    "BEVEL": changing(REFINES, "the bevel's width is of the moved shape"),
    "BOOLEAN": changing(MAKES, "the cut is where the other object stands, and moves with the surface"),
    "BUILD": changing(HIDES, "it shows more faces from frame to frame"),
    "DECIMATE": changing(MAKES, "it would choose other vertices for each moved shape"),
    "EDGE_SPLIT": changing(REFINES, "it splits sharp edges of the moved shape, and tears nothing"),
    "MASK": changing(HIDES, "what it hides moves with the rest"),
    "MESH_TO_VOLUME": changing(MAKES, "of volumes alone"),
    "MIRROR": changing(MAKES, "the field moves both halves"),
    "MULTIRES": changing(REFINES, "its detail turns with the moved shape"),
    "NODES": changing(MAKES, "nodes may make the shape"),
    "REMESH": changing(MAKES, "it would make other vertices for each moved shape"),
    "SCREW": changing(MAKES, "the field moves the surface, not its profile"),
    "SKIN": changing(MAKES, "the field moves the surface, not its edges"),
    "SOLIDIFY": changing(REFINES, "the thickness is of the moved shape"),
    "SUBSURF": changing(REFINES, "few vertices move, and the moved shape is smooth"),
    "TRIANGULATE": changing(REFINES, "polygons are divided by the moved shape"),
    "VOLUME_TO_MESH": changing(MAKES, "the surface is made here"),
    "WELD": changing(MAKES, "distances at rest say what is one"),
    "WIREFRAME": changing(REFINES, "the thickness is of the moved shape"),
    "LINEART": changing(MAKES, "of Grease Pencil alone"),
    # Deform
    "ARMATURE": keeping(MOVES, "the field acts on the posed shape, but where it is told the unposed one"),
    "CAST": keeping(MOVES, "the field acts on the shape that is seen"),
    "CORRECTIVE_SMOOTH": keeping(MOVES, "it would smooth the field's motion away"),
    "CURVE": keeping(MOVES, "the field acts on the shape that is seen"),
    "DISPLACE": keeping(MOVES, "the field acts on the shape that is seen"),
    "HOOK": keeping(MOVES, "the field acts on the shape that is seen"),
    "LAPLACIANDEFORM": keeping(MOVES, "its anchors are bound to the shape at rest"),
    "LAPLACIANSMOOTH": keeping(MOVES, "handles hold the points that are seen"),
    "LATTICE": keeping(MOVES, "the field acts on the shape that is seen"),
    "MESH_DEFORM": keeping(MOVES, "it is bound to the shape at rest"),
    "SHRINKWRAP": keeping(MOVES, "it would take the shape back onto its target"),
    "SIMPLE_DEFORM": keeping(MOVES, "the field acts on the shape that is seen"),
    "SMOOTH": keeping(MOVES, "handles hold the points that are seen"),
    "SURFACE_DEFORM": keeping(MOVES, "it is bound to the shape at rest"),
    "VOLUME_DISPLACE": changing(MAKES, "of volumes alone"),
    "WARP": keeping(MOVES, "the field acts on the shape that is seen"),
    "WAVE": keeping(MOVES, "the field acts on the shape that is seen"),
    # Physics
    "CLOTH": keeping(MOVES, "a simulation would take the field's motion back"),
    "COLLISION": keeping(USES, "others collide with the surface that is seen"),
    "DYNAMIC_PAINT": changing(USES, "it paints where the surface is seen, or is painted there"),
    "EXPLODE": changing(USES, "pieces fly off the moved surface"),
    "FLUID": changing(USES, "a fluid meets the surface that is seen"),
    "OCEAN": changing(MAKES, "the waves are made here"),
    "PARTICLE_INSTANCE": changing(MAKES, "handles take hold of all copies"),
    "PARTICLE_SYSTEM": keeping(USES, "hair grows on the surface that is seen"),
    "SOFT_BODY": keeping(MOVES, "a simulation would take the field's motion back"),
    "SURFACE": keeping(USES, "force fields act from the surface that is seen"),
}


def kind_of(modifier):
    if modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN":
        return UNKNOWN  # the fluid is its shape
    return KINDS.get(modifier.type, UNKNOWN)


def follows_field(modifier):
    """Whether a new field modifier is put before this one at the end of a stack, or pinned there."""
    return kind_of(modifier).follows_field or getattr(modifier, "use_pin_to_last", False)


def kind_keeps_vertices(modifier):
    """Whether every vertex keeps its index."""
    return kind_of(modifier).keeps


def uses_surface(modifier):
    """Whether what it does is bound to the surface where it stands, and stays if the field comes later."""
    return kind_of(modifier).role == USES


# The place of the field's modifier in an object's stack, and the object's shape there.
#
# The shape is evaluated on a copy with a shortened stack, in a temporary scene: the user's data are
# unchanged.

STAGE = "arapfields_stage"  # custom property of the scene that holds the copy
TIME = ("fps", "fps_base", "frame_map_old", "frame_map_new")  # render settings that map frames to time
FREE_NORMALS = "custom_normal"  # attribute of custom normals; free ones are vectors, Blender 4.5 and later
# Modifiers before which Blender allows deform modifiers only; nodes count as others.
ORIGINAL = {"MULTIRES", "SOFT_BODY"}


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
    """The modifiers of earlier results below the field's, in stack order."""
    return [modifier for modifier in source.modifiers if is_layer(modifier)]


def is_layer(modifier):
    return modifier.type == "NODES" and modifier.node_group is not None and LAYER_GROUP in modifier.node_group


def top(source):
    """The object's field modifier, else its last layer, else None."""
    return find(source) or next(reversed(layers(source)), None)


def place(source):
    """Index of the field modifier in the stack, or the index for a new one: that of the cache modifier, else
    before modifiers that only refine, hide or use the shape (modifier_kinds), or before armatures if the
    unposed shape is solved."""
    stack = list(source.modifiers)
    own = next((index for index, one in enumerate(stack) if is_field(one) or is_cache(one)), None)
    if own is not None:
        return own
    if holds_splats(source):  # later modifiers draw them
        return 0
    last = first_posing(source) if settings_of(source).under_rig else end(stack)
    return max(min(last, first_laid_on(source)), earliest(stack))


def end(stack):
    """Index for a new deform modifier at the end of a stack, before modifiers that only refine, hide or use
    the shape."""
    index, least = len(stack), earliest(stack)
    while index > least and follows_field(stack[index - 1]):
        index -= 1
    return index


def first_posing(source):
    """Index of the first modifier that poses a source; the stack's length without one."""
    stack = list(source.modifiers)
    return next((index for index, one in enumerate(stack) if is_posing(source, one)), len(stack))


def first_laid_on(source):
    """Index of a carried object's first Shrinkwrap modifier onto another object of the same field: its
    carrier or one that this carries; the stack's length without one."""
    stack, carrier = list(source.modifiers), settings_of(source).carried_by
    moved = [] if carrier is None else [carrier, *(one.item for one in settings_of(carrier).carried)]
    laid = (i for i, one in enumerate(stack) if one.type == "SHRINKWRAP" and one.target in moved)
    return next(laid, len(stack))


def earliest(stack):
    """The lowest index for a nodes modifier in a stack."""
    return max((index + 1 for index, one in enumerate(stack) if one.type in ORIGINAL), default=0)


def before(source, in_place):
    """The modifiers that make the shape to solve: those before the field's place, else all but the add-on's.

    Armatures whose bones are handles are left out: the field replaces them.
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
    """Whether a modifier is an Armature modifier of one of these armatures."""
    return modifier.type == "ARMATURE" and modifier.object in rigs


def rig_of(modifier):
    """The armature of an Armature modifier, or None; a lost library leaves an Empty there."""
    rig = modifier.object if modifier.type == "ARMATURE" else None
    return rig if rig is not None and rig.type == "ARMATURE" else None


def is_posing(source, modifier):
    """Whether this is an Armature modifier that poses the object, with no handles on its armature's bones."""
    return rig_of(modifier) is not None and not is_replaced(modifier, handle_rigs(source))


def left_behind(source):
    """The modifiers that use the surface before the field moves it, such as hair, and so do not follow it."""
    stack = list(source.modifiers)[: place(source)]
    return [one for one in stack if one.show_viewport and uses_surface(one)]


def shown_before(source, in_place):
    return [modifier for modifier in before(source, in_place) if modifier.show_viewport]


def behind(source):
    """The modifiers after the field's."""
    return [one for one in list(source.modifiers)[place(source) :] if not (is_field(one) or is_cache(one))]


def keeps_vertices(source):
    """Whether the vertices at the field's place are the mesh's own, by index, in viewport and render."""
    return all(
        kind_keeps_vertices(modifier) or is_layer(modifier)
        for modifier in before(source, in_place=True)
        if modifier.show_viewport or modifier.show_render
    )


def is_stage(scene):
    return STAGE in scene


@contextmanager
def evaluated(context, source, kept, frame=None):
    """Context manager: (evaluated object, its depsgraph) with the modifiers `kept` only, at the current frame
    or another."""
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
    """Context manager: (copy, view layer) of the object with the modifiers `kept` only, in a temporary
    scene."""
    stage = bpy.data.scenes.new("ARAP Fields")
    copied = None
    try:
        stage[STAGE] = True
        stage.frame_current, stage.frame_subframe = context.scene.frame_current, context.scene.frame_subframe
        for name in TIME:
            setattr(stage.render, name, getattr(context.scene.render, name))
        layer = stage.view_layers[0]
        updated(layer)  # the frame is set while the scene is empty
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
    """A copy of the object that shares its mesh, with the modifiers `kept` only."""
    copied = source.copy()
    copied.hide_viewport = False
    for modifier in list(copied.modifiers):
        if modifier.name not in kept:
            remove_modifier(modifier)
    return copied


@contextmanager
def evaluated_mesh(context, source, in_place=False, frame=None):
    """Context manager: the evaluated mesh of the shape to solve."""
    with mesh_of(context, source, before(source, in_place), frame) as mesh:
        yield mesh


@contextmanager
def moved_mesh(context, source):
    """Context manager: the evaluated mesh right after the field's modifier."""
    with mesh_of(context, source, list(source.modifiers)[: place(source) + 1]) as mesh:
        yield mesh


@contextmanager
def mesh_of(context, source, kept, frame=None):
    """Context manager: the evaluated mesh or point cloud with the modifiers `kept` only. Blender has one such
    mesh of an object at a time: there is no second one within."""
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
    """A new mesh of the shape to solve."""
    with evaluated(context, source, before(source, in_place)) as (item, depsgraph):
        return bpy.data.meshes.new_from_object(item, preserve_all_data_layers=True, depsgraph=depsgraph)


def free_normals(mesh):
    """The domain of free custom normals (POINT, FACE or CORNER), or "" if normals rotate with the mesh."""
    normals = mesh.attributes.get(FREE_NORMALS)
    return normals.domain if normals is not None and normals.data_type == "FLOAT_VECTOR" else ""
