# SPDX-License-Identifier: GPL-3.0-or-later
"""The style of a solve, by its settings or by the shape of an object."""

from dataclasses import dataclass

import bmesh
import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack, vertex_groups
from ..blender.evaluation import depsgraph_of
from ..blender.object_references import settings_of
from ..blender.property_definitions import effective_value
from ..core.errors import UserError
from ..core.geometry.spaces import pose, upright
from ..core.runtime import native
from ..core.settings.choices import CUSTOM, style_name
from ..handles import empties
from ..handles.empties import matrix_of

# A mesh object as a style: its native ObjectStyle, cached by a fingerprint of mesh and matrix.

MOST_NORMALS = 64  # face normals of an object without a volume; with more it is no style
KEPT = 8  # size of the cache: objects, or orientations of one
style_cache = {}  # key → ObjectStyle or (k, 3) normals


def object_refusal(item):
    """UserError if an object cannot be a style, without reading its mesh; else None."""
    if item.type != "MESH":
        return UserError("{name} is no mesh; a mesh object is needed as a style", item)
    return None


def style_of(item, where=matrix_of):
    """(style, key): an ObjectStyle in the world's directions, or the (k, 3) face normals of an object without
    a volume; equal keys for equal styles. UserError that names the object if it gives neither."""
    reason = object_refusal(item)
    if reason is not None:
        raise reason
    linear = np.asarray(where(item), dtype=np.float64)[:3, :3]
    seen = item if modifier_stack.find(item) else item.evaluated_get(depsgraph_of(bpy.context))
    mesh = seen.to_mesh()
    try:
        key = mesh_arrays.fingerprint(mesh), linear.tobytes()
        if key not in style_cache:
            while len(style_cache) >= KEPT:
                del style_cache[next(iter(style_cache))]
            style_cache[key] = _read(item.name, mesh, linear)
        return style_cache[key], key
    finally:
        seen.to_mesh_clear()


def _read(name, mesh, linear):
    reason = mesh_arrays.nothing_in(name, len(mesh.vertices), len(mesh.polygons))
    if reason is not None:
        raise reason
    af = native.library()
    points, corners = mesh_arrays.positions(mesh) @ linear.T, mesh_arrays.triangles(mesh)
    for close in (False, True):
        if close:
            points, corners = _closed(points, corners)
        try:
            return af.ObjectStyle(points, corners)
        except af.InvalidInput:
            continue
    return _face_normals(name, mesh, linear)


def _closed(points, corners):
    """The mesh with coincident vertices merged and its holes filled."""
    points, which = np.unique(points, axis=0, return_inverse=True)
    closed = bmesh.new()
    vertices = [closed.verts.new(point) for point in points]
    for a, b, c in which.reshape(-1)[corners]:
        if len({a, b, c}) == 3 and not closed.faces.get((vertices[a], vertices[b], vertices[c])):
            closed.faces.new((vertices[a], vertices[b], vertices[c]))
    bmesh.ops.holes_fill(closed, edges=[edge for edge in closed.edges if edge.is_boundary], sides=0)
    bmesh.ops.recalc_face_normals(closed, faces=closed.faces)
    bmesh.ops.triangulate(closed, faces=closed.faces)
    closed.verts.index_update()
    points = np.array([vertex.co for vertex in closed.verts], dtype=np.float64).reshape(-1, 3)
    corners = np.array([[v.index for v in face.verts] for face in closed.faces], dtype=np.int64).reshape(
        -1, 3
    )
    closed.free()
    return points, corners


def _face_normals(name, mesh, linear):
    """(k, 3) distinct unit normals of the faces, in world space."""
    normals = np.empty(3 * len(mesh.polygons), dtype=np.float32)
    mesh.polygons.foreach_get("normal", normals)
    turned = normals.reshape(-1, 3).astype(np.float64) @ np.linalg.pinv(linear)  # by the inverse transpose
    turned = turned[np.linalg.norm(turned, axis=1) > 0]
    turned = np.unique(np.round(turned / np.linalg.norm(turned, axis=1, keepdims=True), 3), axis=0)
    if not 0 < len(turned) <= MOST_NORMALS:
        raise UserError(
            "{name} encloses no volume, and has {count} different face normals; a closed object, or from 1 "
            "to {most} normals, make a style",
            name=name,
            count=len(turned),
            most=MOST_NORMALS,
        )
    return turned / np.linalg.norm(turned, axis=1, keepdims=True)


# The style that an object's settings choose: preferred normals, their axes, and where it acts.


@dataclass(frozen=True)
class Style:
    """`normals`: a native style's name, (k, 3) normals or an ObjectStyle; `turn`: (3, 3) rotation into solve
    space; `up`: (3,) there; `identity`: a key, equal for equal styles before the rotation."""

    normals: object
    turn: np.ndarray
    up: np.ndarray
    identity: object

    def directions(self, af):
        """(k, 3) preferred normals in solve space, or the ObjectStyle there."""
        plain = af.preferred_normals(self.normals) if isinstance(self.normals, str) else self.normals
        return plain @ self.turn.T if isinstance(plain, np.ndarray) else plain.turned(self.turn)

    def key(self):
        """Equal for equal styles."""
        return self.identity, self.turn.tobytes(), self.up.tobytes()


def refusal(source):
    """UserError that says why an object's settings give no style; else None."""
    settings = settings_of(source)
    style = settings.stylize
    held = empties.require_handles(source) if style.use_handles else None
    reason = held or missing_object(style.style, style.frame, style)
    return reason or vertex_groups.missing(source, group_names(source, style))


def is_begun(source):
    """Whether the user still has to choose the object or the handle that the settings need."""
    settings = settings_of(source).stylize
    lacks_handle = settings.use_handles and not empties.used(source)
    return lacks_handle or missing_object(settings.style, settings.frame, settings) is not None


def missing_object(which, frame, settings):
    """UserError if a style, or its axes, need an object that is not chosen; else None."""
    if which in CUSTOM:
        if settings.style_object is None:
            return UserError("Choose the object that gives the style its normals")
        if which == "OBJECT":
            return object_refusal(settings.style_object)
    elif frame == "EMPTY" and settings.frame_object is None:
        return UserError("Choose the object along whose axes the style stands")
    return None


def requested_style(settings, space, operator=None, where=matrix_of):
    """The Style of an object's settings, overridden by the operator's arguments if given."""

    def setting(name):
        return effective_value(name, settings, operator)

    which = setting("style")
    reason = missing_object(which, setting("frame"), settings)
    if reason is not None:
        raise reason
    to_solve = pose(space.world_to_solve)[:3, :3]
    up = to_solve[:, 2]
    if which in CUSTOM:
        if which == "OBJECT":
            normals, key = style_of(settings.style_object, where)
            return Style(normals, to_solve, up, key)
        turn = pose(where(settings.style_object))[:3, :3]
        return Style(np.concatenate([np.eye(3), -np.eye(3)]), to_solve @ turn, up, which)
    name = style_name(which)
    if setting("frame") == "OBJECT":
        return Style(name, np.eye(3), up, name)
    turn = axes(setting("frame"), space, settings.frame_object, where)
    return Style(name, to_solve @ turn, up, name)


def axes(which, space, item, where=matrix_of):
    """(3, 3) axes of the style in the world, as columns."""
    if which == "UPRIGHT":
        return upright(pose(space.solve_to_world)[:3, :3])
    if which == "WORLD":
        return np.eye(3)
    return pose(where(item))[:3, :3]


def group_names(source, settings):
    """The vertex groups that a stylization uses."""
    held = empties.group_names(source) if settings.use_handles else []
    return [*held, settings.region] if settings.region else held


def region_weights(context, source, settings, of_groups, in_place):
    """(n,) weights of the vertices: vertex group (one of those by name) times material; None for
    everywhere."""
    weights = of_groups[settings.region] if settings.region else None
    if settings.region_material is not None:
        held = material_weights(context, source, settings.region_material, in_place)
        weights = held if weights is None else weights * held
    if weights is not None and not weights.any():
        raise UserError("The region of {name} holds no vertex", source)
    return weights


def material_weights(context, source, material, in_place):
    """(n,) 1 at the vertices of faces with that material."""
    slots = [index for index, slot in enumerate(source.material_slots) if slot.material == material]
    if not slots:
        raise UserError("{name} does not use the material {material}", source, material=material.name)
    with modifier_stack.evaluated_mesh(context, source, in_place) as mesh:
        numbers = np.empty(len(mesh.polygons), dtype=np.int32)
        counts, corners = np.empty_like(numbers), np.empty(len(mesh.loops), dtype=np.int32)
        mesh.polygons.foreach_get("material_index", numbers)
        mesh.polygons.foreach_get("loop_total", counts)
        mesh.loops.foreach_get("vertex_index", corners)
        weights = np.zeros(len(mesh.vertices))
    weights[corners[np.repeat(np.isin(numbers, slots), counts)]] = 1.0
    return weights
