# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluated meshes (modifiers, shape keys) as arrays, and meshes from arrays."""

import hashlib
from bisect import bisect_left
from dataclasses import dataclass, replace

import bmesh
import bpy
import numpy as np

from ..core.errors import UserError, refuse
from ..core.geometry.transfer import vertex_areas
from . import modifier_stack, splat_layouts
from .point_data import face_count, points_of


@dataclass(frozen=True)
class MeshArrays:
    """An evaluated mesh in local coordinates."""

    vertices: np.ndarray  # (n, 3) float64
    triangles: np.ndarray  # (m, 3) int32
    has_free_normals: bool = False  # custom normals that do not rotate with the mesh
    splats: splat_layouts.Splats | None = None  # if the vertices are splats
    materials: np.ndarray | None = None  # (m,) index of each triangle's material; None: the first


def vectors(elements, name="vector"):
    """(n, 3) float32 of a collection, e.g. attribute data, whose elements have a vector `name`."""
    flat = np.empty(3 * len(elements), dtype=np.float32)
    elements.foreach_get(name, flat)
    return flat.reshape(-1, 3)


def put_vectors(elements, values, name="vector"):
    elements.foreach_set(name, np.ascontiguousarray(values, dtype=np.float32).ravel())


def position_vectors(mesh):
    """(collection, property name) of the positions of a mesh or point cloud."""
    attribute = mesh.attributes.get("position")
    return (points_of(mesh), "co") if attribute is None else (attribute.data, "vector")


def positions(mesh):
    """(n, 3) positions of a mesh's vertices or a point cloud's points, as float64."""
    return vectors(*position_vectors(mesh)).astype(np.float64)


def fingerprint(mesh):
    """Comparable fingerprint of a mesh's own vertices and faces, without modifiers and shape keys."""
    digest = hashlib.blake2b(positions(mesh).tobytes(), digest_size=16)
    faces = face_count(mesh)
    if faces:
        digest.update(corner_vertices(mesh).tobytes())
    return digest.digest(), faces


def set_positions(mesh, points):
    """Sets the positions of a mesh's vertices."""
    elements, name = position_vectors(mesh)
    put_vectors(elements, points, name)
    if len(points):  # by this alone Blender 4 measures the bounding box anew
        points_of(mesh)[0].co = points[0]
    mesh.update()


def corner_vertices(mesh):
    """(c,) vertex index of each face corner of a mesh."""
    corners = np.empty(len(mesh.loops), dtype=np.int32)
    attribute = mesh.attributes.get(".corner_vert")
    if attribute is not None:
        attribute.data.foreach_get("value", corners)
    return corners


def triangles_of(mesh, face):
    """(k, 3) vertex indices of the loop triangles of one of the mesh's faces."""
    mesh.calc_loop_triangles()
    drawn = mesh.loop_triangles  # in the faces' order
    first = bisect_left(range(len(drawn)), face, key=lambda index: drawn[index].polygon_index)
    count = mesh.polygons[face].loop_total - 2
    return np.array([drawn[first + index].vertices for index in range(count)]).reshape(-1, 3)


def triangles(mesh):
    """(m, 3) vertex indices of the mesh's loop triangles."""
    if not face_count(mesh):  # then there is no corner attribute
        return np.empty((0, 3), dtype=np.int32)
    mesh.calc_loop_triangles()
    corners = corner_vertices(mesh)
    if len(mesh.loops) == 3 * len(mesh.polygons):  # triangles only: no need to read loop triangles
        return corners.reshape(-1, 3)
    flat = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
    mesh.loop_triangles.foreach_get("loops", flat)
    return corners[flat].reshape(-1, 3)


def materials_of(source, mesh):
    """(m,) index, among the materials of the source's mesh, of each loop triangle of its evaluated mesh; None
    where all have the first."""
    own = list(source.data.materials)
    if len(own) < 2 or not face_count(mesh):
        return None
    faces = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("material_index", faces)
    shown = [None if one is None else one.original for one in mesh.materials]
    if shown != own:  # modifiers have added some
        known = [own.index(one) if one in own else 0 for one in shown] or [0]
        faces = np.array(known, dtype=np.int32)[np.minimum(faces, len(known) - 1)]
    mesh.calc_loop_triangles()
    triangles = np.empty(len(mesh.loop_triangles), dtype=np.int32)
    mesh.loop_triangles.foreach_get("polygon_index", triangles)
    return np.clip(faces[triangles], 0, len(own) - 1) if faces.any() else None


def refusal(source):
    """UserError if an object has no geometry, without evaluating it; else None."""
    if source.modifiers or source.mode == "EDIT":
        return None
    return nothing_in_splats(source.name, source.data)


def nothing_in_splats(name, mesh):
    """The UserError for a mesh without vertices, and for one that has neither faces nor splats."""
    is_splats = splat_layouts.layout_of(mesh) is not None
    return nothing_in(name, len(points_of(mesh)), is_splats or face_count(mesh))


def nothing_in(name, vertices, faces):
    """The UserError for a mesh of so many vertices and faces; None where it has some."""
    if not vertices:
        return UserError("{name}: the mesh is empty", name=name)
    return None if faces else UserError("{name}: the mesh has no faces", name=name)


def flat(name, vertices, triangles):
    """The UserError for triangles of which none has an area."""
    has_area = vertex_areas(vertices, triangles).any()
    return None if has_area else UserError("{name}: its faces have no area", name=name)


def read(context, source, in_place=False, frame=None):
    """The MeshArrays of an object at the current frame or another; UserError that names it if it has no
    geometry."""
    with modifier_stack.evaluated_mesh(context, source, in_place, frame) as mesh:
        return arrays_of(source, mesh)


def arrays_of(source, mesh):
    """The MeshArrays of an object's evaluated mesh; UserError if it has no geometry."""
    normals = bool(modifier_stack.free_normals(mesh))
    materials = materials_of(source, mesh) if source.type == "MESH" else None
    arrays = MeshArrays(positions(mesh), triangles(mesh), normals, materials=materials)
    refuse(nothing_in_splats(source.name, mesh))
    if not np.isfinite(arrays.vertices).all():
        broken = np.flatnonzero(~np.isfinite(arrays.vertices).all(axis=1))
        raise UserError(
            "{name}: {count} vertices are at invalid locations, the first is {first}",
            source,
            count=len(broken),
            first=broken[0],
        )
    if splat_layouts.layout_of(mesh) is not None:
        return replace(arrays, splats=splat_layouts.Splats(source.name, mesh, arrays.vertices))
    return arrays


def new_mesh(name, vertices, topology):
    """A smooth-shaded triangle mesh from (n, 3) positions and a core.topology.Topology."""
    mesh = bpy.data.meshes.new(name)
    fill(mesh, vertices, topology)
    return mesh


def fill(mesh, vertices, topology):
    """Replaces the mesh's geometry by these (n, 3) positions and this topology."""
    mesh.clear_geometry()
    mesh.vertices.add(len(vertices))
    mesh.edges.add(len(topology.edges))
    mesh.loops.add(topology.corners.size)
    mesh.polygons.add(len(topology.corners))
    data = mesh.attributes
    data[".edge_verts"].data.foreach_set("value", topology.edges.ravel())
    data[".corner_vert"].data.foreach_set("value", topology.corners.ravel())
    data[".corner_edge"].data.foreach_set("value", topology.corner_edges.ravel())
    mesh.polygons.foreach_set("loop_start", np.arange(0, topology.corners.size, 3, dtype=np.int32))
    if topology.materials is not None:
        mesh.polygons.foreach_set("material_index", topology.materials)
    set_positions(mesh, vertices)


def take_geometry(mesh, given):
    """Replaces the mesh's vertices, edges and faces by those of another, without other attributes; a mesh of
    the same topology keeps its own."""
    topology = topology_of(given)
    if not same_topology(mesh, given):
        mesh.clear_geometry()
        for part in ("vertices", "edges", "loops", "polygons"):
            getattr(mesh, part).add(len(getattr(given, part)))
        for name, numbers in topology.items():
            if name == "loop_start":
                mesh.polygons.foreach_set(name, numbers)
            elif numbers.size:
                mesh.attributes[name].data.foreach_set("value", numbers)
    set_positions(mesh, positions(given))


def topology_of(mesh):
    """{name: flat int32 array}: vertices of edges and corners, edges of corners, first corners of faces."""
    numbers = {}
    for name, width in ((".edge_verts", 2), (".corner_vert", 1), (".corner_edge", 1)):
        attribute = mesh.attributes.get(name)
        numbers[name] = np.empty(width * len(attribute.data) if attribute is not None else 0, dtype=np.int32)
        if numbers[name].size:
            attribute.data.foreach_get("value", numbers[name])
    numbers["loop_start"] = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_start", numbers["loop_start"])
    return numbers


def same_topology(mesh, other):
    """Whether two meshes have the same edges and faces, by index."""
    ours, theirs = topology_of(mesh), topology_of(other)
    return len(mesh.vertices) == len(other.vertices) and all(
        np.array_equal(ours[name], theirs[name]) for name in ours
    )


def take_all(mesh, given):
    """Replaces what a mesh has by what another has, also its attributes and materials."""
    copied = bmesh.new()
    copied.from_mesh(given)
    copied.to_mesh(mesh)
    copied.free()
    mesh.materials.clear()
    for material in given.materials:
        mesh.materials.append(material)
    mesh.update()
