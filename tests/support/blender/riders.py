# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects of each kind, carried by a bar at its right end, and their evaluated points."""

import bpy
import numpy as np
from support.blender import scenes

import arapfields

# Whether Grease Pencil has its points as attributes: from 4.3 on, renamed in 5.0.
WITH_PENCILS = hasattr(bpy.data, "grease_pencils_v3") or bpy.app.version >= (5, 0)


def body():
    """(bar, moving): a bar that carries nothing, and the handle of its right end."""
    bar, _, moving = scenes.bar_with_handles()
    return bar, moving


def link(name, data, location=(0, 0, 0)):
    item = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(item)
    item.location = location
    return item


def rider(kind):
    """An object of that kind at the right end of the bar."""
    points = np.array([(0.9, 0.1, 0.27), (1.0, -0.1, 0.3), (0.95, 0.0, 0.35), (1.0, 0.1, 0.4)])
    at = np.array((0.2, 0.0, 0.1))  # the object's origin
    if kind == "MESH":
        mesh = bpy.data.meshes.new("Patch")
        mesh.from_pydata((points - at).tolist(), [], [(0, 1, 2, 3)])
        return link("Patch", mesh, at)
    if kind == "CURVES":
        curves = bpy.data.hair_curves.new("Hair")
        curves.add_curves([2, 2])
        curves.attributes["position"].data.foreach_set("vector", (points - at).astype(np.float32).ravel())
        return link("Hair", curves, at)
    if kind == "GREASEPENCIL":
        if not WITH_PENCILS:
            import pytest  # some Blenders that use riders without this kind have none

            pytest.skip("Grease Pencil has points as attributes from Blender 4.3 on")
        pencils = getattr(bpy.data, "grease_pencils_v3", bpy.data.grease_pencils)  # renamed in 5.0
        pencil = pencils.new("Ink")
        drawing = pencil.layers.new("Lines").frames.new(1).drawing
        drawing.add_strokes([2, 2])
        drawing.attributes["position"].data.foreach_set("vector", (points - at).astype(np.float32).ravel())
        return link("Ink", pencil, at)
    if kind == "CURVE":
        curve = bpy.data.curves.new("Cord", "CURVE")
        curve.dimensions = "3D"
        spline = curve.splines.new("POLY")
        spline.points.add(3)
        spline.points.foreach_set("co", np.c_[points - at, np.ones(4)].astype(np.float32).ravel())
        return link("Cord", curve, at)
    if kind == "LATTICE":
        item = link("Cage", bpy.data.lattices.new("Cage"), (1.0, 0, 0.3))
        item.scale = (0.2, 0.2, 0.2)
        return item
    if kind == "ARMATURE":
        item = link("Tail", bpy.data.armatures.new("Tail"))
        bpy.context.view_layer.objects.active = item
        bpy.ops.object.mode_set(mode="EDIT")
        bone = item.data.edit_bones.new("Tip")
        bone.head, bone.tail = (0.9, 0, 0.3), (0.9, 0, 0.5)
        bpy.ops.object.mode_set(mode="OBJECT")
        return item
    item = link("Spot", None, (1.0, 0.05, 0.3))
    item.rotation_mode, item.rotation_euler, item.scale = "XYZ", (0.1, 0.2, 0.3), (0.1, 0.2, -0.3)
    return item


def shown(item):
    """(n, 3) evaluated points of an object, in world space."""

    bpy.context.view_layer.update()
    seen = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    matrix = np.array(seen.matrix_world)
    if item.type == "MESH":
        points = [v.co for v in seen.data.vertices]
    elif item.type == "CURVES":
        points = [p.vector for p in seen.data.attributes["position"].data]
    elif item.type == "GREASEPENCIL":
        points = [p.vector for p in seen.data.layers[0].frames[0].drawing.attributes["position"].data]
    elif item.type == "CURVE":
        points = [v.co for v in seen.to_mesh().vertices]
    elif item.type == "LATTICE":
        points = [p.co_deform for p in seen.data.points]
    elif item.type == "ARMATURE":
        points = [seen.pose.bones[0].head, seen.pose.bones[0].tail]
    else:
        points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    points = np.array([tuple(point) for point in points])
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def taken(session, points):
    """(n, 3) points moved by a live session's field."""
    return arapfields.Attachment(session.solver.samples, points).positions(session.solver.field)
