# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes weights to vertex groups, and correctives to shape keys with simple driver expressions.

Blender evaluates simple expressions without Python, so they work with auto-run off and without the extension.
"""

import bpy
import numpy as np

from ..blender import mesh_arrays, vertex_groups
from ..names import CORRECTIVE
from ..results.placement import single_user
from . import rig as rigs
from .shapes import place

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
    elif not (rigs.is_posed_by_parent(item) and item.parent == rig):
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
