# SPDX-License-Identifier: GPL-3.0-or-later
"""The armature that a mesh is skinned to, and weights and correctives written onto the mesh."""

from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils.kdtree import KDTree

from ..blender import mesh_arrays, modifier_stack, object_references, vertex_groups
from ..blender.object_references import ObjectReference
from ..core.errors import UserError, refuse
from ..core.geometry.spaces import facing, inverse, is_in_place, space_of, transform
from ..handles.movers import matrix_of
from ..names import CORRECTIVE
from ..results.placement import single_user
from ..stiffness import painted

# The armature and the meshes to skin, checks for both, and native bones of the armature.

# Radians: largest joint limit, and the limit of an axis without one if other axes have some.
WIDEST, FREE = np.radians(60.0), np.radians(25.0)


def rig_of(context):
    """The armature: the active or a selected object, else the one that the active mesh follows; or None."""
    active, selected = object_references.active_of(context), context.selected_objects
    found = next((item for item in (active, *selected) if item and item.type == "ARMATURE"), None)
    if found is None and active is not None and active.type == "MESH":
        found = next((rig for rig in followed(active)), None)
    return found


def followed(item):
    """The armatures that deform a mesh object, by a modifier or as its parent."""
    rigs = [rig for rig in map(modifier_stack.rig_of, item.modifiers) if rig is not None]
    return rigs + ([item.parent] if is_posed_by_parent(item) else [])


def is_posed_by_parent(item):
    return item.parent is not None and item.parent.type == "ARMATURE" and item.parent_type == "ARMATURE"


def meshes_of(context, rig, scope):
    """The mesh objects to skin; objects of handles and results are left out."""
    within = context.selected_objects
    if scope == "COLLECTION":
        within = [item for home in rig.users_collection for item in home.all_objects]
    found = [item for item in dict.fromkeys(within) if item.type == "MESH"]
    return [item for item in found if object_references.owner_of(item) is None]


def refusal(rig, meshes):
    """UserError that says why these meshes cannot be skinned; else None."""
    if rig is None or not meshes:
        return UserError("Select the meshes, then the armature")
    if not rig.data.bones:
        return UserError("The armature {rig} has no bones to pose", rig=rig.name)
    if not any(bone.use_deform for bone in rig.data.bones):
        return UserError("No bone of {rig} deforms", rig=rig.name)
    if rig.mode == "EDIT":
        return UserError("{name} is in Edit Mode; leave it first", rig)
    return next(filter(None, (refusal_of(rig, item) for item in meshes)), None)


def refusal_of(rig, item):
    """UserError that says why a mesh cannot be skinned; else None."""
    reason = object_references.refusal(item)
    if reason is not None:
        return reason
    if item.library is not None or item.data.library is not None:
        return UserError("{name} is linked from another file; make it local first", item)
    if rig in modifier_stack.handle_rigs(item):
        return UserError("The bones of {name} are handles of {source}", rig, source=item.name)
    if item.parent == rig and item.parent_type == "BONE":
        return UserError("{name} moves with a bone already; clear its parent first", item)
    return None


@contextmanager
def at_rest(context, rig):
    """Context manager: sets the armature to its Rest Position."""
    shown = rig.data.pose_position
    rig.data.pose_position = "REST"
    context.view_layer.update()
    try:
        yield
    finally:
        rig.data.pose_position = shown
        context.view_layer.update()


def bones_of(af, rig):
    """All bones of the armature at rest, in its coordinates, as af.Bone."""
    numbers = {bone.name: index for index, bone in enumerate(rig.data.bones)}
    found = []
    for bone in rig.data.bones:
        parent = numbers[bone.parent.name] if bone.parent else None
        _, roll = bone.AxisRollFromMatrix(bone.matrix_local.to_3x3())
        limits = limits_of(rig.pose.bones[bone.name])
        found.append(
            af.Bone(
                tuple(bone.head_local),
                tuple(bone.tail_local),
                parent,
                roll,
                deform=bone.use_deform,
                limits=limits,
                name=bone.name,
            )
        )
    return found


def rest_of(rig):
    """Comparable rest pose of the bones."""
    return [
        (
            bone.name,
            bone.parent and bone.parent.name,
            bone.use_deform,
            bone.length,
            *map(tuple, bone.matrix_local),
        )
        for bone in rig.data.bones
    ]


def limits_of(bone):
    """(3, 2) lower and upper rotation limit per axis of a pose bone, in radians; None without limits."""
    limits, has_any = np.array([[-FREE, FREE]] * 3), False
    sources = [(bone, "use_ik_limit_{}", "ik_min_{}", "ik_max_{}")]
    sources += [
        (one, "use_limit_{}", "min_{}", "max_{}")
        for one in bone.constraints
        if one.type == "LIMIT_ROTATION" and one.owner_space == "LOCAL" and not one.mute
    ]
    for source, *names in sources:
        for row, axis in zip(limits, "xyz", strict=True):
            used, least, most = (getattr(source, name.format(axis)) for name in names)
            if used:
                has_any, row[:] = True, np.clip((least, most), -WIDEST, WIDEST)
    return limits if has_any else None


# Writes weights and corrective shape keys to meshes.

# Meshes at rest to skin, in the armature's coordinates, and the weights of their vertex groups.


@dataclass
class Shape:
    """One mesh object; its shape is the input of its Armature modifier, present or future."""

    reference: ObjectReference
    arrays: mesh_arrays.MeshArrays
    vertices: np.ndarray  # (n, 3) in the armature's coordinates
    triangles: np.ndarray
    to_rig: np.ndarray  # (4, 4) object's → armature's coordinates
    nearest: np.ndarray | None  # (own vertices,) index into `vertices`; None if these are the mesh's own
    kept: dict  # {bone: (own vertices,) weights to keep}
    stiffness: tuple  # (n,) factors of stiffness, of bending stiffness; each None if all are 1
    mark: tuple

    def own(self, weights):
        """The rows of the mesh's own vertices."""
        return weights if self.nearest is None else weights[self.nearest]

    def get(self, rig):
        """The object; UserError if its mesh, or its placement relative to the armature, has changed."""
        item = self.reference.get()
        is_there = is_in_place(transform(to_armature(item, rig), self.arrays.vertices), self.vertices)
        if mesh_arrays.fingerprint(item.data) != self.mark or not is_there:
            raise UserError("{name} changed while it was worked on; run again", item)
        return item


def place(item, rig):
    """Index of the Armature modifier in the object's stack, or the index to insert it at."""
    stack = list(item.modifiers)
    found = next((k for k, m in enumerate(stack) if m.type == "ARMATURE" and m.object == rig), None)
    if found is not None:
        return found
    end = len(stack)
    while end and modifier_stack.follows_field(stack[end - 1]):
        end -= 1
    return end


def read(context, item, rig, groups):
    """The Shape of an object while the armature is at rest; UserError if there is nothing to skin."""
    refuse(painted.refusal(item))
    to_rig = to_armature(item, rig)
    before = [m for m in list(item.modifiers)[: place(item, rig)] if m.show_viewport]
    with modifier_stack.mesh_of(context, item, before) as mesh:
        arrays = mesh_arrays.arrays_of(item, mesh)
        refuse(mesh_arrays.flat(item.name, arrays.vertices, arrays.triangles))
        painted_groups = {name: item.vertex_groups[name].index for name in painted.names(item)}
        stiffness = painted.of_weights(item, vertex_groups.weights_in(mesh, painted_groups))
    own = mesh_arrays.positions(item.data)
    keeps = all(map(modifier_stack.kind_keeps_vertices, before)) and len(own) == len(arrays.vertices)
    return Shape(
        ObjectReference(item),
        arrays,
        transform(to_rig, arrays.vertices),
        facing(arrays.triangles, to_rig),
        to_rig,
        None if keeps else nearest(arrays.vertices, own),
        kept_weights(item, rig, groups),
        stiffness,
        mesh_arrays.fingerprint(item.data),
    )


def to_armature(item, rig):
    """(4, 4) from an object's coordinates into the armature's; UserError if either matrix is singular."""
    for one in (item, rig):
        space_of(matrix_of(one), one.name)
    return inverse(matrix_of(rig)) @ matrix_of(item)


def nearest(vertices, points):
    """(p,) index of the vertex, of (n, 3), that is nearest to each point."""
    tree = KDTree(len(vertices))
    for index, vertex in enumerate(vertices):
        tree.insert(vertex, index)
    tree.balance()
    return np.array([tree.find(point)[1] for point in points])


def kept_weights(item, rig, groups):
    """{bone: (own vertices,) weights} of the groups that stay: locked ones, and with `groups` KEEP all that
    are not empty."""
    deforming = {bone.name for bone in rig.data.bones if bone.use_deform}
    own = [group for group in item.vertex_groups if group.name in deforming]
    locked = {group.name for group in own if group.lock_weight}
    found = vertex_groups.weights_in(item.data, {group.name: group.index for group in own})
    return {
        name: weights
        for name, weights in found.items()
        if name in locked or (groups == "KEEP" and weights.any())
    }


def fill_up(weights, kept, names, influences, points):
    """(n, bones) weights: the kept columns stay, the others are scaled to a sum of 1 with them. Of the (n, 3)
    points, one without weights gets those of the nearest point that has some."""
    if not kept:
        return weights
    fixed = [names.index(bone) for bone in kept]
    result = weights.copy()
    result[:, fixed] = 0.0
    held = np.stack(list(kept.values()), axis=1)
    room = np.clip(influences - (held > 0).sum(axis=1), 1, influences)
    order = np.argsort(np.argsort(-result, axis=1, kind="stable"), axis=1)
    result[order >= room[:, None]] = 0.0
    bare, others = ~(result.any(axis=1) | held.any(axis=1)), np.flatnonzero(result.any(axis=1))
    if bare.any() and len(others):
        result[bare] = result[others[nearest(points[others], points[bare])]]
    total, left = result.sum(axis=1), np.clip(1.0 - held.sum(axis=1), 0.0, 1.0)
    result *= (left / np.where(total > 0, total, 1.0))[:, None]
    result[:, fixed] = held
    return result


def join(shapes):
    """((n, 3) vertices, (m, 3) triangles, index of each shape's first vertex) of all shapes as one mesh."""
    firsts = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
    rows = [shape.triangles + first for shape, first in zip(shapes, firsts, strict=False)]
    return np.concatenate([shape.vertices for shape in shapes]), np.concatenate(rows), firsts


def joined_stiffness(shapes):
    """[(n,) factors of stiffness, of bending stiffness] of all shapes as one mesh; None for ones."""
    joined = []
    for parts in zip(*(shape.stiffness for shape in shapes), strict=True):
        ones = [np.ones(len(shape.vertices)) for shape in shapes]
        filled = [one if part is None else part for one, part in zip(ones, parts, strict=True)]
        joined.append(None if all(part is None for part in parts) else np.concatenate(filled))
    return joined


# Writes weights to vertex groups, and correctives to shape keys with simple driver expressions.
#
# Blender evaluates simple expressions without Python, so they work with auto-run off and without the
# extension.

LEAST_OFFSET = 1e-5  # of the shape's size; a corrective that moves a mesh by less is left out
QUATERNION = "wxyz"
PRODUCTS = ("w*x", "w*y", "w*z", "x*x", "y*y", "z*z", "x*y", "x*z", "y*z")  # in the order of af.Corrective


def write_weights(item, names, weights, kept):
    """Writes (n, bones) weights to the bones' vertex groups; groups of `kept` stay."""
    single_user(item)
    columns = dict(zip(names, np.asarray(weights).T, strict=True))
    used = {name for name, column in columns.items() if column.any() or name in item.vertex_groups}
    if any(m.type == "MIRROR" and m.use_mirror_vertex_groups for m in item.modifiers):
        # Mirror finds the other side's group by its name: that group must exist.
        used |= {bpy.utils.flip_name(name) for name in used}
    for name, column in columns.items():
        if name in used and name not in kept:
            vertex_groups.put(item, name, column)


def follow(item, rig):
    """Makes the armature deform the object, by its modifier or a new one, and parents it to the armature."""
    modifier = next((m for m in item.modifiers if m.type == "ARMATURE" and m.object == rig), None)
    if modifier is not None:
        modifier.use_vertex_groups = True
    elif not (is_posed_by_parent(item) and item.parent == rig):
        index = place(item, rig)
        modifier = item.modifiers.new("Armature", "ARMATURE")
        modifier.object = rig
        item.modifiers.move(len(item.modifiers) - 1, index)
    if item.parent is None:
        item.parent = rig
        item.matrix_parent_inverse = rig.matrix_world.inverted()


def takes_correctives(item, shape):
    """Whether shape keys can move the skinned vertices."""
    keys = item.data.shape_keys
    return shape.nearest is None and (keys is None or keys.use_relative) and not item.show_only_shape_key


def remove_correctives(item):
    keys = item.data.shape_keys
    for key in list(keys.key_blocks) if keys else ():
        if key.name.startswith(CORRECTIVE):
            key.driver_remove("value")
            item.shape_key_remove(key)


def add_correctives(item, rig, shape, rows, correctives, names):
    """Adds shape keys with these rows of the correctives' offsets; returns their number."""
    back, size = np.linalg.inv(shape.to_rig[:3, :3]), np.ptp(shape.vertices, axis=0).max()
    count = 0
    for number, corrective in enumerate(correctives, 1):
        offsets = corrective.offsets[rows]
        if np.abs(offsets).max() < LEAST_OFFSET * size:
            continue
        if item.data.shape_keys is None:
            item.shape_key_add(name="Basis", from_mix=False)
        bone = names[corrective.bone]
        key = item.shape_key_add(name=f"{CORRECTIVE}{number} {bone}", from_mix=False)
        basis = mesh_arrays.vectors(key.relative_key.data, "co").astype(np.float64)
        mesh_arrays.put_vectors(key.data, basis + offsets @ back.T, "co")
        key.slider_min, key.slider_max = -1.0, 1.0  # the range of the sampled poses
        drive(key, rig, bone, corrective.coefficients)
        count += 1
    return count


def drive(key, rig, bone, coefficients):
    """Drives the key's value by this polynomial of the bone's local rotation, a unit quaternion."""
    driver = key.driver_add("value").driver
    driver.type = "SCRIPTED"
    for component in QUATERNION:
        variable = driver.variables.new()
        variable.name, variable.type = component, "TRANSFORMS"
        target = variable.targets[0]
        target.id, target.bone_target = rig, bone
        target.transform_type, target.transform_space = f"ROT_{component.upper()}", "LOCAL_SPACE"
        target.rotation_mode = "QUATERNION"
    driver.expression = formula(coefficients)


def formula(coefficients):
    """The driver expression, at most 255 characters, Blender's limit."""
    for digits in (7, 4):
        terms = [f"{c:+.{digits}g}*{product}" for c, product in zip(coefficients, PRODUCTS, strict=True)]
        text = "".join(terms).removeprefix("+")
        if len(text) < 256:
            break
    return text
