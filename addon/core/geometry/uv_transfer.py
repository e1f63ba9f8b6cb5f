# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfers UV coordinates to the face corners of another mesh, whose faces may cross seams."""

import numpy as np

# A seam lies between a corner and its face's center if the corner's UV is off the extrapolated one by more
# than this many times the extrapolated change.
CUT = 3.0


def fan(vertices, starts, corners):
    """((n + m, 3) vertices and face centers, (c, 3) triangles, (c,) face of each corner)."""
    counts = np.diff(np.append(starts, len(corners)))
    face = np.repeat(np.arange(len(starts)), counts)
    centres = np.add.reduceat(vertices[corners], starts) / counts[:, None]
    following = np.arange(1, len(corners) + 1)
    following[starts + counts - 1] = starts
    triangles = np.stack([len(vertices) + face, corners, corners[following]], axis=1).astype(np.int32)
    return np.concatenate([vertices, centres]), triangles, face


def corner_coordinates(points, places, shares, corners, face, moved, uv):
    """((c, 2) UVs of face corners, (c,) whether a seam separates the corner from its face's center).

    `points` (n + m, 3) of `fan` lie on triangle `places` (n + m,) at barycentric coordinates `shares`
    (n + m, 3); `moved` (t, 3, 3) are the triangles' corners, `uv` (t, 3, 2) their UVs. Beyond a seam, the UV
    map at the face's center is extrapolated.
    """
    at = (shares[:, :, None] * uv[places]).sum(axis=1)
    centre = len(points) - (face.max() + 1) + face
    own = places[centre]
    sides = moved[own][:, 1:] - moved[own][:, :1]
    slopes = uv[own][:, 1:] - uv[own][:, :1]
    metric = sides @ sides.transpose(0, 2, 1)
    metric += 1e-9 * np.trace(metric, axis1=1, axis2=2)[:, None, None] * np.eye(2) + 1e-30 * np.eye(2)
    offset = points[corners] - points[centre]
    parts = np.linalg.solve(metric, (sides @ offset[:, :, None]))[:, :, 0]
    step = (parts[:, :, None] * slopes).sum(axis=1)
    straight, direct = at[centre] + step, at[corners]
    beyond = np.linalg.norm(direct - straight, axis=1) > CUT * np.linalg.norm(step, axis=1) + 1e-6
    return np.where(beyond[:, None], straight, direct), beyond
