# SPDX-License-Identifier: GPL-3.0-or-later
"""What a source does not pass, read as it is shown."""

import hashlib
from typing import NamedTuple

import numpy as np

from ..blender import mesh_arrays
from ..blender.evaluation import depsgraph_of
from ..blender.object_references import settings_of
from ..blender.property_definitions import from_single_precision
from ..core.errors import UserError
from ..core.geometry.spaces import space_of, transform
from ..core.runtime import native


class ContactTerm(NamedTuple):
    """In solve space; where two have the same `key`, they are equal."""

    key: str
    solids: tuple  # ((n, 3) vertices, (m, 3) triangles)
    margin: float
    ground: float | None  # height along `up`
    up: tuple  # (3,)
    itself: bool

    def made(self):
        """The library's Contact; on a worker."""
        af = native.library()
        obstacles = [af.Obstacle(af.MeshSdf(*solid), self.margin) for solid in self.solids]
        return af.Contact(obstacles, ground=self.ground, up=self.up, itself=self.itself)


def native_contact(term):
    return None if term is None else term.made()


def obstacles_of(source, group):
    """The objects that are in the way: the one that is chosen, and the visible meshes of the collection."""
    found = [group.obstacle] if group.obstacle is not None else []
    if group.obstacles is not None:
        found += [item for item in group.obstacles.all_objects if item.type == "MESH" and item.visible_get()]
    carried = [entry.item for entry in settings_of(source).carried]
    return [item for item in dict.fromkeys(found) if item != source and item not in carried]


def refusal(source):
    """The UserError of obstacles that cannot be, as far as it is seen without reading; else None."""
    group = settings_of(source).contact
    if not group.use:
        return None
    if group.obstacle is not None and group.obstacle.type != "MESH":
        return UserError("{name} is no mesh; a mesh object is needed as an obstacle", group.obstacle)
    if group.obstacle == source:
        return UserError("{name} cannot be its own obstacle", source)
    if not (group.use_ground or group.itself or obstacles_of(source, group)):
        return UserError("{name}: Contact has neither an obstacle nor a ground, nor itself", source)
    return None


def contact_of(source, settings, space, depsgraph):
    """The ContactTerm that an object's settings, maybe as a render has them, ask for; or None."""
    group = settings.contact
    if not group.use:
        return None
    reason = refusal(source)
    if reason is not None:
        raise reason
    world = space.solve_to_world
    scale = float(np.cbrt(abs(np.linalg.det(world[:3, :3]))))
    margin, ground = (from_single_precision(value) for value in (group.margin, group.ground))
    height = (ground - world[2, 3]) / scale if group.use_ground else None
    up = tuple((world[2, :3] / scale).tolist())
    solids = tuple(read(item, space, depsgraph) for item in obstacles_of(source, group))
    hashed = hashlib.sha1(repr((margin / scale, height, up, group.itself)).encode())
    for part in (array for solid in solids for array in solid):
        hashed.update(np.ascontiguousarray(part).tobytes())
    return ContactTerm(hashed.hexdigest(), solids, margin / scale, height, up, group.itself)


def for_job(context, source):
    """The same for a solve of its own."""
    space = space_of(source.matrix_world, source.name)
    return contact_of(source, settings_of(source), space, depsgraph_of(context))


def read(item, space, depsgraph):
    """(vertices, triangles) of an obstacle as it is shown, in solve space."""
    seen = item.evaluated_get(depsgraph)
    mesh = seen.to_mesh()
    try:
        arrays = mesh_arrays.arrays_of(item, mesh)
    finally:
        seen.to_mesh_clear()
    to_solve = space.world_to_solve @ np.asarray(seen.matrix_world, dtype=np.float64)
    return transform(to_solve, arrays.vertices), arrays.triangles
