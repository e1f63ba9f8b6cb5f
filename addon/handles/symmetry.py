# SPDX-License-Identifier: GPL-3.0-or-later
"""The mirror plane of a source whose sides are deformed symmetrically: through its origin, or the mesh's own
plane of symmetry where that is elsewhere, as after an import."""

import numpy as np
from mathutils.kdtree import KDTree

from ..blender import modifier_stack
from ..blender.mesh_arrays import positions
from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..core.geometry.spaces import space_of
from .movers import matrix_of

COMPARED = 3000  # most vertices that are compared with their mirror images
SYMMETRIC = (
    0.02  # of the mesh's size: mean distance of mirror images from the mesh, below which it is symmetric
)
FEW = 64  # vertices that tell whether a mesh is the one whose plane is known


class Planes(dict):
    """{(session_uid of a mesh, axis): (what it was found for, offset)}."""

    def offset(self, source, axis, to_solve):
        """How far the source's own plane of symmetry is from its origin along an axis of solve space; 0 where
        the origin's plane is one, or the mesh has none across that axis."""
        vertices = source.data.vertices
        few = np.linspace(0, len(vertices) - 1, min(FEW, len(vertices))).astype(int).tolist()
        state = len(vertices), np.array([vertices[index].co for index in few]).tobytes(), to_solve.tobytes()
        known = self.get((source.data.session_uid, axis))
        if known is None or known[0] != state:
            points = positions(source.data)[:: 1 + len(vertices) // COMPARED].astype(np.float64)
            known = self[source.data.session_uid, axis] = state, own_plane(points @ to_solve.T, axis)
        return known[1]


planes = Planes()


def own_plane(points, axis):
    """Where the plane is, along an axis, across which (n, 3) points are symmetric, if they are not across 0;
    else 0."""
    if not len(points):
        return 0.0
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    tree = KDTree(len(points))
    for index, point in enumerate(points.tolist()):
        tree.insert(point, index)
    tree.balance()

    def is_symmetric(plane):
        mirrored = points.copy()
        mirrored[:, axis] = 2 * plane - mirrored[:, axis]
        away = [tree.find(point)[2] for point in mirrored[:: 1 + len(points) // 500].tolist()]
        return np.mean(away) < SYMMETRIC * size

    middle = float(points[:, axis].min() + points[:, axis].max()) / 2
    return middle if not is_symmetric(0.0) and is_symmetric(middle) else 0.0


def offset_of(source, plane=None):
    """How far the plane of a source's Symmetry is from its origin along the axis of solve space.

    `plane`: x, y, z or none; by default the source's setting.
    """
    plane = (plane or settings_of(source).deform.symmetry).lower()
    if plane == "none" or source.type != "MESH" or not modifier_stack.keeps_vertices(source):
        return 0.0
    to_solve = space_of(matrix_of(source), source.name).local_to_solve[:3, :3]
    return planes.offset(source, "xyz".index(plane), to_solve)


def space_for(source, matrix, plane=None):
    """The solve space of a source with this world matrix, in which the plane of its Symmetry is at 0."""
    plane = (plane or settings_of(source).deform.symmetry).lower()
    space, offset = space_of(matrix, source.name), offset_of(source, plane)
    return space.shifted("xyz".index(plane), offset) if offset else space


def beside(source, plane=None):
    """UserError that says which plane is used in place of the origin's; else None."""
    try:
        offset = offset_of(source, plane)
    except UserError:
        return None
    if not offset:
        return None
    return UserError(
        "Symmetry is across the middle of {name}, as its origin lies beside it; Set Origin puts it there",
        source,
    )


def mirror_of(source):
    """(4, 4) world → world reflection across the plane of the source's Symmetry; None without one.

    Also None while a style, which ignores symmetry, is live, or if the source's scale flattens it.
    """
    settings = settings_of(source)
    plane = settings.deform.symmetry.lower()
    if plane == "none" or settings.live_kind == "STYLIZE":
        return None
    try:
        return space_for(source, matrix_of(source)).mirror("xyz".index(plane))
    except UserError:
        return None


def is_on_plane(mirror, box):
    """Whether the center of a box, cube [-1, 1]³ → world, is on the mirror plane."""
    extent = np.linalg.norm(box[:3, :3], axis=0).max()
    return np.linalg.norm((mirror @ box - box)[:3, 3]) <= 1e-3 * extent
