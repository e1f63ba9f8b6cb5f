# SPDX-License-Identifier: GPL-3.0-or-later
"""Points and point attributes of meshes and point clouds."""

import bpy
import numpy as np


def points_of(data):
    """The vertices of a mesh, or the points of a point cloud."""
    return data.points if isinstance(data, bpy.types.PointCloud) else data.vertices


def face_count(data):
    return 0 if isinstance(data, bpy.types.PointCloud) else len(data.polygons)


def shape_keys_of(data):
    """The shape keys of a mesh, or None."""
    return None if isinstance(data, bpy.types.PointCloud) else data.shape_keys


def selection_of(data):
    """(n,) bool: the points that are selected in Edit Mode."""
    chosen = np.zeros(len(points_of(data)), dtype=bool)
    if not isinstance(data, bpy.types.PointCloud):
        data.vertices.foreach_get("select", chosen)
    elif ".selection" in data.attributes:
        data.attributes[".selection"].data.foreach_get("value", chosen)
    return chosen
