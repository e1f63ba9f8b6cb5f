# SPDX-License-Identifier: GPL-3.0-or-later
"""The target under the cursor: a handle, the active handle's ring, or a surface with its highlight."""

from dataclasses import dataclass

import numpy as np
from bpy_extras import view3d_utils

from ..blender import mesh_arrays
from ..blender.object_references import ObjectReference, settings_of, source_of
from ..blender.splat_layouts import holds_splats
from ..carried import carrying
from ..core.geometry.edges import connected, parts_of
from ..core.geometry.spaces import inverse, transform
from ..field_modifier import motion
from ..handles.empties import matrix_of
from . import pins, screen

REACH = 14  # picking radius of a handle in pixels, at UI scale 1
SPLAT_REACH = 6  # picking radius of a splat in pixels, at UI scale 1
RING, RING_REACH = (
    46,
    7,
)  # radius in pixels of the active handle's ring, and how near to it the cursor meets it


@dataclass(frozen=True)
class Target:
    """`kind` is HANDLE, RING, SURFACE, REFUSED for an object that cannot be pinned, or OTHER for one that is
    not the tool's object."""

    kind: str
    source: ObjectReference
    empty: ObjectReference | None = None
    location: np.ndarray | None = None  # (3,) on the surface, in world space
    normal: np.ndarray | None = None
    radius: float = 0.0  # in the world, of the region that a pin there would hold
    face: int = -1  # index in the evaluated mesh, which has `face_count` faces
    face_count: int = 0
    lit: np.ndarray | None = None  # (k, 3, 3) triangles within the radius, in world space


class Hover:
    """The target and the pixel of the last mouse move, the running drag, and where a press has missed."""

    def __init__(self):
        self.clear()

    def clear(self):
        self.target = self.drag = self.pixel = self.missed = self.region = None
        self.label = ""  # what a press does there

    @property
    def held(self):
        """The running drag while its button is pressed; None while its shape settles."""
        return None if self.drag is None or self.drag.is_released else self.drag


hover = Hover()


class View:
    """The 3D view that an event came from."""

    def __init__(self, context, event):
        self.region, self.view = context.region, context.region_data
        self.pixel = event.mouse_region_x, event.mouse_region_y
        self.size = self.region.width, self.region.height
        self.perspective = np.array(self.view.perspective_matrix)
        self.scale = context.preferences.system.ui_scale

    def ray(self):
        """(origin, direction) of the line of sight, in world space."""
        return (
            view3d_utils.region_2d_to_origin_3d(self.region, self.view, self.pixel),
            view3d_utils.region_2d_to_vector_3d(self.region, self.view, self.pixel),
        )

    def beside(self, location, offset=(0, 0)):
        """The world location at the depth of `location`, under the cursor plus an offset in pixels."""
        pixel = np.add(self.pixel, offset)
        return view3d_utils.region_2d_to_location_3d(self.region, self.view, pixel, location)

    def pixel_of(self, location):
        return screen.project(self.perspective, self.size, location)[0]

    @property
    def is_inside(self):
        """Whether the cursor is over the view."""
        return all(0 <= at < size for at, size in zip(self.pixel, self.size, strict=True))

    @property
    def towards(self):
        """The axis that points at the viewer."""
        return self.view.view_rotation @ type(self.view.view_location)((0, 0, 1))


def under(context, view, lights=False, other=False):
    """The Target under the cursor, or None. Handles take precedence, even behind the mesh.

    `lights`: also finds the triangles to highlight, which is slow on a large mesh. `other`: an object that is
    not the tool's is a SURFACE as well.
    """
    handles = pins.handles_in_view(context)
    spots = screen.project(
        view.perspective,
        view.size,
        [e.empty.matrix_world.translation for _, e in handles] or np.empty((0, 3)),
    )
    index = screen.nearest(spots, view.pixel, REACH * view.scale)
    if index >= 0:
        source, entry = handles[index]
        return Target("HANDLE", ObjectReference(source), ObjectReference(entry.empty))
    active = pins.chosen(context)
    for (source, entry), spot in zip(handles, spots, strict=True):
        away = np.linalg.norm(spot - view.pixel) - RING * view.scale
        if entry.empty == active and not entry.anchor and abs(away) <= RING_REACH * view.scale:
            return Target("RING", ObjectReference(source), ObjectReference(active))
    return surface(context, view, lights, None if other else object_of(context))


def object_of(context):
    """The tool's object: the active one, or its carrier; None where none is active that has a surface."""
    source = source_of(context)
    if source is None or not pins.is_own(source) or not source.visible_get():
        return None
    return carrier_of(source) or source


def surface(context, view, lights, own=None):
    """The Target of the first surface along the line of sight; None if it cannot be pinned. `own`: the tool's
    object, or None for any."""
    depsgraph = context.evaluated_depsgraph_get()
    met, location, normal, face, item, matrix = context.scene.ray_cast(depsgraph, *view.ray())
    splat = splat_under(context, view, own)
    if splat is not None and (not met or (splat.location - np.array(location)) @ view.towards > 0):
        return splat
    if not met or not pins.is_own(item.original) or matrix != item.original.matrix_world:
        return None
    source = carrier_of(item.original)
    if own not in (None, source or item.original):
        return Target("OTHER", ObjectReference(source or item.original))
    if source is not None:
        location, normal, face = beneath(source.evaluated_get(depsgraph), view.ray(), location)
    else:
        source = item.original
    if pins.refusal(source) is not None:
        return Target("REFUSED", ObjectReference(source))
    location = np.array(location)
    radius = context.scene.arapfields.pin_radius * screen.pixel_size(view.perspective, view.size, location)
    mesh = source.evaluated_get(depsgraph).data
    return Target(
        "SURFACE",
        ObjectReference(source),
        location=location,
        normal=np.array(normal),
        radius=radius,
        face=face,
        face_count=len(mesh.polygons),
        lit=lit(mesh, matrix_of(source), location, radius) if lights else None,
    )


def carrier_of(item):
    """The visible mesh that carries an object without handles of its own, or None."""
    settings = settings_of(item)
    carrier = settings.carried_by
    if carrier is None or carrying.find(carrier, item) is None or len(settings.handles):
        return None
    return carrier if carrier.visible_get() and carrier.type == "MESH" and carrier.data.polygons else None


def beneath(carrier, ray, location):
    """(location, normal, face) of an evaluated mesh along a line of sight, or nearest to a location."""
    world = carrier.matrix_world
    local = world.inverted_safe()
    met, place, normal, face = carrier.ray_cast(local @ ray[0], local.to_3x3() @ ray[1])
    if not met:
        _, place, normal, face = carrier.closest_point_on_mesh(local @ location)
    return world @ place, (local.to_3x3().transposed() @ normal).normalized(), face


def splat_under(context, view, own):
    """The Target of the splat under the cursor that is nearest to the viewer, or None."""
    best, towards = None, np.array(view.towards)
    for source in context.visible_objects:
        if not holds_splats(source) or not pins.is_own(source):
            continue
        points, world = motion.shown_points(source), matrix_of(source)
        index = screen.foremost(
            view.perspective @ world,
            view.size,
            points,
            towards @ world[:3, :3],
            view.pixel,
            SPLAT_REACH * view.scale,
        )
        location = None if index < 0 else transform(world, points[index : index + 1])[0]
        if location is None or (best is not None and (location - best[1]) @ towards <= 0):
            continue
        best = source, location
    if best is None:
        return None
    source, location = best
    if own not in (None, source):
        return Target("OTHER", ObjectReference(source), location=location)
    if pins.refusal(source) is not None:
        return Target("REFUSED", ObjectReference(source), location=location)
    radius = context.scene.arapfields.pin_radius * screen.pixel_size(view.perspective, view.size, location)
    where = {"location": location, "normal": towards, "radius": radius, "lit": np.empty((0, 3, 3))}
    return Target("SURFACE", ObjectReference(source), **where)


def lit(mesh, world, location, radius):
    """(k, 3, 3) the triangles of a mesh with a corner within the radius of the location, in world space, of
    what is connected with it there."""
    points = mesh_arrays.positions(mesh).astype(np.float32)
    least = np.linalg.svd(world[:3, :3], compute_uv=False).min()  # smallest world length per local one
    middle = transform(inverse(world), location[None])[0]
    kept = ((points - middle.astype(np.float32)) ** 2).sum(axis=1) <= (radius / least) ** 2
    corners = mesh_arrays.triangles(mesh)
    chosen = transform(world, points[corners[kept[corners].any(axis=1)]].reshape(-1, 3)).reshape(-1, 3, 3)
    chosen = chosen[np.linalg.norm(chosen - location, axis=2).min(axis=1) <= radius]
    if len(chosen) and parts_of(chosen).any():  # more than one: the whole mesh tells which belong together
        ball = (transform(world, points) - location) / radius
        chosen = chosen[connected((chosen.mean(axis=1) - location) / radius, ball, corners)]
    return chosen.astype(np.float32)
