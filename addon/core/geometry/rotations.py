# SPDX-License-Identifier: GPL-3.0-or-later
"""How a field turns what lies on its points."""

import numpy as np

TINY = 1e-12


def turns(jacobians, local_to_solve):
    """(n, 3) rotation vectors (axis · angle) in local coordinates, float32, of a field's (n, 3, 3) Jacobians.

    `local_to_solve` is the (4, 4) map into the field's space. The turn is that of the closest rotation.
    """
    linear = np.asarray(local_to_solve)[:3, :3]
    left, _, right = np.linalg.svd(np.linalg.inv(linear) @ jacobians @ linear)
    left[..., 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    return rotation_vectors(left @ right).astype(np.float32)


def rotation_vectors(rotations):
    """(n, 3) axis · angle of (n, 3, 3) rotations, angles from 0 to π."""
    r = rotations
    twice = np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=1)
    sine = np.linalg.norm(twice, axis=1) / 2
    cosine = (np.trace(r, axis1=1, axis2=2) - 1) / 2
    angle = np.arctan2(sine, cosine)
    result = twice / 2 * np.where(sine > TINY, angle / np.maximum(sine, TINY), 1.0)[:, None]
    half = (cosine < 0) & (sine < 1e-4)  # near π the axis is that of the symmetric part
    if half.any():
        outer = (r[half] + np.swapaxes(r[half], 1, 2)) / 2 + np.eye(3)
        longest = np.linalg.norm(outer, axis=1).argmax(axis=1)
        axis = np.take_along_axis(outer, longest[:, None, None], axis=2)[..., 0]
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        axis *= np.where((axis * twice[half]).sum(axis=1) < 0, -1.0, 1.0)[:, None]
        result[half] = axis * angle[half, None]
    return result


def best_rotation(before, after):
    """(3, 3) the rotation that takes (n, 3) points nearest to those after, both about their means."""
    before, after = before - before.mean(axis=0), after - after.mean(axis=0)
    left, _, right = np.linalg.svd(after.T @ before)
    return left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))]) @ right
