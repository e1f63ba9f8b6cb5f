# SPDX-License-Identifier: GPL-3.0-or-later
"""A source's contact settings, and its obstacles as evaluated meshes."""

import hashlib
from typing import NamedTuple

import bpy
import numpy as np

from ..blender import mesh_arrays
from ..blender.evaluation import depsgraph_of, has_keys
from ..blender.object_references import in_scene, settings_of
from ..blender.property_definitions import from_single_precision
from ..core.errors import UserError
from ..core.geometry.spaces import inverse, space_of, transform
from ..core.runtime import native

DIGITS = 5  # of a non-uniform scale; rounded, so that a rotation in single precision keeps a solid's key


class Solid(NamedTuple):
    """An obstacle. Solids of equal `key` have equal vertices and triangles."""

    key: str
    vertices: np.ndarray  # (n, 3) in a space of its own
    triangles: np.ndarray  # (m, 3)
    placement: np.ndarray  # (4, 4) from there into solve space: a similarity
    margin: float
    name: str


class ContactTerm(NamedTuple):
    """Contact in solve space; terms of equal `key` are equal."""

    key: str
    solids: tuple  # of Solid
    ground: float | None  # height along `up`
    up: tuple  # (3,)
    itself: bool

    def made(self, known=None):
        """The native Contact; on a worker. `known`: cache {key of a Solid: MeshSdf}, updated in place, so
        that an obstacle that only moves keeps its signed distance."""
        af, known = native.library(), {} if known is None else known
        distances = {
            solid.key: known.get(solid.key) or af.MeshSdf(solid.vertices, solid.triangles)
            for solid in self.solids
        }
        known.clear()
        known.update(distances)
        obstacles = [
            af.Obstacle(distances[solid.key], solid.margin, placement=solid.placement)
            for solid in self.solids
        ]
        return af.Contact(obstacles, ground=self.ground, up=self.up, itself=self.itself)

    def touched(self, known, points, near):
        """(n,) whether points in solve space are within `near` of a margin; `known`: the cache of made()."""
        result = np.zeros(len(points), dtype=bool)
        if self.ground is not None:
            result |= points @ np.array(self.up) < self.ground + near
        for solid in self.solids:
            scale = np.cbrt(np.linalg.det(solid.placement[:3, :3]))
            there = transform(inverse(solid.placement), points)
            result |= scale * np.asarray(known[solid.key](there)) < solid.margin + near
        return result


def native_contact(term, known=None):
    return None if term is None else term.made(known)


def notes_on(term, handles, report):
    """UserErrors by a solve's report: obstacles that cross the surface, handles held back by contact."""

    def solid(name):
        return term.solids[int(name.removeprefix("obstacles[").rstrip("]"))]

    found = [
        UserError("{name} crosses the surface; what lies inside of it stays there", solid(name))
        for name in report.contact.crossing
    ]
    if report.contact.self_intersections:
        found.append(UserError("Parts of the shape still pass through each other"))
    for held in report.contact.held:
        handle = handles[held.handle]
        if not handle.name:  # holds the region that is far from all pins
            continue
        if held.by == "ground":
            found.append(UserError("{name} is held back by the ground", handle))
        elif held.by == "itself":
            found.append(UserError("{name} is held back by the surface itself", handle))
        else:
            found.append(UserError("{name} is held back by {other}", handle, other=solid(held.by).name))
    return found


def listed(entry):
    """The objects of a row in the list of obstacles."""
    return entry.group.all_objects if entry.group is not None else [entry.item]


def lasting(source):
    """Comparable state that playback does not change: session_uids of the listed objects that are in a scene,
    and of active obstacles whose visibility is not animated."""
    rows = settings_of(source).contact.obstacle_list
    in_way = {item.session_uid for item, _ in obstacles_of(source) if not blinks(item)}
    return {item.session_uid for entry in rows for item in listed(entry) if in_scene(item)}, in_way


def blinks(item):
    """Whether keyframes, NLA strips or drivers may hide an object."""
    data, path = item.animation_data, "hide_viewport"
    if data is None:
        return False
    return bool(data.nla_tracks) or has_keys(item, path) or any(one.data_path == path for one in data.drivers)


def obstacles_of(source):
    """[(object, margin)] of a source's active obstacles, each object once."""
    carried, found = {entry.item for entry in settings_of(source).carried}, {}
    for entry in settings_of(source).contact.obstacle_list:
        for item in listed(entry):
            acts = item is not None and item.type == "MESH" and item != source and item not in carried
            if acts and is_shown(item):
                found.setdefault(item, from_single_precision(entry.margin))
    return list(found.items())


def is_shown(item):
    """Whether an object is visible in the view layer, local view aside."""
    layer, space = bpy.context.view_layer, bpy.context.space_data
    if item.visible_get(view_layer=layer):
        return True
    in_local_view = getattr(space, "local_view", None) is not None
    return in_local_view and not (item.hide_viewport or item.hide_get(view_layer=layer))


def entry_refusal(source, entry):
    """UserError that says why a row of the list is no active obstacle; else None."""
    if entry.group is not None:
        return refusal_of_group(source, entry.group)
    if entry.item is None or not in_scene(entry.item):
        return UserError("{name} is in no scene any more", entry) if entry.name else None
    if entry.item == source:
        return UserError("{name} cannot be its own obstacle", source)
    if entry.item.type != "MESH":
        return UserError("{name} is no mesh; a mesh object is needed as an obstacle", entry.item)
    if entry.item in {carried.item for carried in settings_of(source).carried}:
        return UserError("{name} is carried, so that it is no obstacle", entry.item)
    if not is_shown(entry.item):
        return UserError("{name} is hidden, so that it is not in the way", entry.item)
    return None


def refusal_of_group(source, group):
    """UserError that says why a collection, or an instance in it, is no active obstacle; else None."""
    shown = [item for item in group.all_objects if is_shown(item)]
    if instance := next((item for item in shown if item.is_instancer and item.type == "EMPTY"), None):
        return UserError("{name} is an instance; make it real to have it in the way", instance)
    in_way = {item for item, _ in obstacles_of(source)}
    if not in_way.isdisjoint(shown):
        return None
    return UserError("{name} has no visible mesh that is in the way", group)


def refusal(source):
    """UserError if contact has no obstacle, ground or self-contact, without reading meshes; else None."""
    group = settings_of(source).contact
    if not group.use or group.use_ground or group.itself or obstacles_of(source):
        return None
    reasons = [entry_refusal(source, entry) for entry in group.obstacle_list]
    nothing = UserError("{name}: Contact has neither an obstacle nor a ground, nor itself", source)
    return next(filter(None, reasons), nothing)


def contact_of(source, settings, space, depsgraph):
    """The ContactTerm of an object's settings, original or evaluated for a render; or None."""
    group = settings.contact
    if not group.use:
        return None
    world = space.solve_to_world
    scale = float(np.cbrt(abs(np.linalg.det(world[:3, :3]))))
    rise = float(np.linalg.norm(world[2, :3]))
    height = (from_single_precision(group.ground) - world[2, 3]) / rise if group.use_ground else None
    up = tuple((world[2, :3] / rise).tolist())
    found = [read(item, margin / scale, space, depsgraph) for item, margin in obstacles_of(source)]
    solids = tuple(solid for solid in found if solid is not None)
    if not solids and height is None and not group.itself:
        return None
    parts = [(solid.key, solid.margin, solid.placement.tolist()) for solid in solids]
    key = hashlib.sha1(repr((parts, height, up, group.itself)).encode()).hexdigest()
    return ContactTerm(key, solids, height, up, group.itself)


def for_job(context, source, fast, space):
    """The ContactTerm of a job in its solve space.

    UserError if contact is empty, or on without the method Fast.
    """
    reason = refusal(source)
    if reason is None and settings_of(source).contact.use and not fast:
        reason = UserError("{name}: Contact needs the method Fast, without Exact Handles", source)
    if reason is not None:
        raise reason
    return contact_of(source, settings_of(source), space, depsgraph_of(context))


def read(item, margin, space, depsgraph):
    """The Solid of an obstacle's evaluated mesh; None if its scale makes it a point."""
    seen = item.evaluated_get(depsgraph)
    mesh = seen.to_mesh()
    try:
        arrays = mesh_arrays.arrays_of(item, mesh)
    finally:
        seen.to_mesh_clear()
    world = np.asarray(seen.matrix_world, dtype=np.float64)
    vertices, triangles = arrays.vertices, arrays.triangles
    to_solve = space.world_to_solve @ world
    try:
        own = space_of(to_solve, item.name)
        vertices, placement = transform(np.round(own.local_to_solve, DIGITS), vertices), own.solve_to_world
    except UserError:  # its scale makes it a flat sheet
        vertices, placement = transform(to_solve, vertices), np.eye(4)
        if np.ptp(vertices, axis=0).max() == 0.0:
            return None
    if np.linalg.det(placement[:3, :3]) < 0.0:
        placement[:3, :3] *= -1.0
        vertices, triangles = -vertices, triangles[:, ::-1]
    hashed = hashlib.sha1(np.ascontiguousarray(vertices).tobytes())
    hashed.update(np.ascontiguousarray(triangles).tobytes())
    return Solid(hashed.hexdigest(), vertices, triangles, placement, margin, item.name)
