# SPDX-License-Identifier: GPL-3.0-or-later
"""Stacks of modifiers and layers of fields."""

import bpy
import numpy as np
from support.blender import scenes

import arapfields
from addon.core.geometry.spaces import space_of

# Stacks of modifiers and layers of fields.

# Bars with several modifiers and the field modifier, and their expected shapes.


def armature():
    """Two bones along x; the second is turned."""
    bpy.ops.object.armature_add()
    item = bpy.context.object
    bpy.ops.object.mode_set(mode="EDIT")
    bones = item.data.edit_bones
    bones[0].head, bones[0].tail = (-1, 0, 0), (0, 0, 0)
    second = bones.new("Second")
    second.head, second.tail, second.parent = (0, 0, 0), (1, 0, 0), bones[0]
    bpy.ops.object.mode_set(mode="OBJECT")
    item.pose.bones["Second"].rotation_mode = "XYZ"
    item.pose.bones["Second"].rotation_euler.z = 0.3
    return item


def add_modifier(bar, kind):
    """Adds a modifier of that kind that changes the shape."""
    if kind == "keys":
        bar.shape_key_add(name="Basis")
        key = bar.shape_key_add(name="Wide")
        for point in key.data:
            point.co.y *= 1.4
        key.value = 0.5
        return
    if kind == "ARMATURE":
        rig = armature()
        for name, side in (("Bone", -1), ("Second", 1)):
            group = bar.vertex_groups.new(name=name)
            x = np.array([vertex.co.x for vertex in bar.data.vertices])
            for index, weight in enumerate(np.clip(0.5 + side * x, 0, 1).tolist()):
                group.add([index], weight, "REPLACE")
        scenes.activate(bar)
    modifier = bar.modifiers.new(kind.title(), kind)
    if kind == "ARMATURE":
        modifier.object = rig
    elif kind == "SUBSURF":
        modifier.levels = modifier.render_levels = 1
    elif kind == "MIRROR":
        modifier.use_axis, modifier.use_mirror_merge = (False, False, True), False
    bpy.context.view_layer.update()


def build(stack):
    """Deforms a bar with this stack by operators; returns (bar, moving, field as a map of local points)."""
    bar, _, moving = scenes.bar_with_handles()
    bar.scale, bar.location, bar.rotation_euler.z = (1.0, 1.2, 0.9), (0.1, 0, 0), 0.2
    bpy.context.view_layer.update()
    for kind in stack:
        if kind != "FIELD":
            add_modifier(bar, kind)
    moving.location.z += 0.4
    fields, solve = [], arapfields.deform

    def noted(*given, **named):
        fields.append(solve(*given, **named))
        return fields[-1]

    arapfields.deform = noted
    try:
        for _ in range(2):
            scenes.activate(bar)
            assert bpy.ops.arapfields.deform(**scenes.QUICK) == {"FINISHED"}
            index = [kind for kind in stack if kind != "keys"].index("FIELD")
            bpy.ops.object.modifier_move_to_index(modifier="ARAP Fields", index=index)
    finally:
        arapfields.deform = solve
    assert len(bpy.data.scenes) == 1
    space = space_of(np.array(bar.matrix_world))
    return bar, moving, lambda points: space.to_local(fields[-1](space.to_solve(points)))


def local_points(item):

    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    evaluated.to_mesh_clear()
    return flat.reshape(-1, 3)


def by_hand(bar, field, share=1.0):
    """(n, 3) expected points: the earlier modifiers applied, moved by the field, then the later modifiers."""
    copied = bar.copy()
    bpy.context.collection.objects.link(copied)
    names = [modifier.name for modifier in bar.modifiers]
    at = names.index("ARAP Fields")
    for name in names[at:]:
        copied.modifiers.remove(copied.modifiers[name])
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    mesh = bpy.data.meshes.new_from_object(
        copied.evaluated_get(depsgraph), preserve_all_data_layers=True, depsgraph=depsgraph
    )
    rest = local_points(copied).astype(np.float64)
    scenes.set_positions(mesh, rest + share * (field(rest) - rest))
    bpy.data.objects.remove(copied)
    copied = bar.copy()
    copied.data = mesh
    for name in names[: at + 1]:
        copied.modifiers.remove(copied.modifiers[name])
    bpy.context.collection.objects.link(copied)
    bpy.context.view_layer.update()
    points = local_points(copied)
    bpy.data.objects.remove(copied)
    return points


# Bars that are stylized and then deformed.

QUICK = {"field": "radial", "samples": 500}
STYLE = {"style": "CUBE", "field": "radial", "samples": 500}
SAME = 2e-6  # for a bar of length 2: single precision of added offsets


def with_handles(bar):
    """Adds handles at both ends of a bar; returns the right one."""
    boxes = [scenes.cube_empty((x, 0, 0), (0.3, 0.6, 0.6), str(x)) for x in (-1, 1)]
    bpy.context.view_layer.update()
    scenes.activate(*boxes, bar)
    assert bpy.ops.arapfields.add_handle() == {"FINISHED"}
    scenes.activate(bar)
    return boxes[1]


def styled(stack=(), **further):
    """(a bent bar, its stylized points, its points before)."""
    bar = scenes.bar()
    scenes.set_positions(bar.data, np.array([bend(v.co) for v in bar.data.vertices]))
    for kind in stack:
        add_modifier(bar, kind)
    rest = scenes.world_points(bar)
    scenes.activate(bar)
    assert bpy.ops.arapfields.stylize(**STYLE, **further) == {"FINISHED"}
    shape = scenes.world_points(bpy.context.object)
    assert np.abs(shape - rest).max() > 0.05
    return bar, shape, rest


def bend(point):
    return point[0], point[1], point[2] + 0.4 * point[0] ** 2


def structure(item):
    """Everything except the shape that must not change, comparable."""
    settings = item.arapfields
    modifiers = [(m.name, m.type, m.show_viewport) for m in item.modifiers]
    modifiers += [m.node_group.name for m in item.modifiers if m.type == "NODES"]
    names = sorted(name for name, _ in item.data.attributes.items())
    return modifiers, names, settings.moved_by, settings.under_rig, sorted(bpy.data.objects.keys())


# Modifier stacks that include the field modifier.

STACKS = {  # FIELD: the field modifier; "keys": shape keys
    "alone": ["FIELD"],
    "subdivision after": ["FIELD", "SUBSURF"],
    "subdivision before": ["SUBSURF", "FIELD"],
    "mirror before": ["MIRROR", "FIELD"],
    "mirror after": ["FIELD", "MIRROR"],
    "armature before": ["ARMATURE", "FIELD"],
    "armature after": ["FIELD", "ARMATURE"],
    "shape keys": ["keys", "FIELD"],
    "all": ["keys", "MIRROR", "ARMATURE", "FIELD", "SUBSURF"],
}
