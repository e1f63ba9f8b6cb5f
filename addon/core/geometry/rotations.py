# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations of a field at points, from its Jacobians."""

import numpy as np

TINY = 1e-12
STEPS, NEAR = 6, 1e-9  # Newton iterations; bound on the last step, whose square bounds the error


def turns(jacobians, local_to_solve):
    """(n, 3) rotation vectors (axis · angle) in local coordinates, float32, of a field's (n, 3, 3) Jacobians.

    `local_to_solve` is the (4, 4) map into the field's space. Uses the closest rotations.
    """
    linear = np.asarray(local_to_solve)[:3, :3]
    return rotation_vectors(closest(np.linalg.inv(linear) @ jacobians @ linear)).astype(np.float32)


def closest(matrices):
    """(n, 3, 3) the rotations closest to matrices, most of which are nearly rotations.

    Newton's iteration for the polar factor, X ← (X + X⁻ᵀ) / 2 (Higham 1986); by SVD if it has not converged
    or leads to a reflection. Non-finite matrices stay non-finite.
    """
    found = np.ascontiguousarray(np.moveaxis(matrices, 0, -1))
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            before, (cofactors, determinants) = found, cofactors_of(found)
            found = (before + cofactors / determinants) / 2
        close = (np.abs(found - before).max(axis=(0, 1)) < NEAR) & (determinants > 0)
    found = np.ascontiguousarray(np.moveaxis(found, -1, 0))
    others = ~close & np.isfinite(matrices).all(axis=(1, 2))
    left, _, right = np.linalg.svd(matrices[others])
    left[..., 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    found[others] = left @ right
    return found


def cofactors_of(m):
    """(3, 3, n) cofactors of (3, 3, n) matrices, and (n,) their determinants."""
    b, c = [1, 2, 0], [2, 0, 1]
    crosses = [m[i, b] * m[j, c] - m[i, c] * m[j, b] for i, j in ((1, 2), (2, 0), (0, 1))]
    return np.stack(crosses), (m[0] * crosses[0]).sum(axis=0)


def rotation_vectors(rotations):
    """(n, 3) axis · angle of (n, 3, 3) rotations, angles from 0 to π."""
    r = rotations
    twice = np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=1)
    sine = np.linalg.norm(twice, axis=1) / 2
    cosine = (np.trace(r, axis1=1, axis2=2) - 1) / 2
    angle = np.arctan2(sine, cosine)
    result = twice / 2 * np.where(sine > TINY, angle / np.maximum(sine, TINY), 1.0)[:, None]
    half = (cosine < 0) & (sine < 1e-4)  # near π the axis is taken from the symmetric part
    if half.any():
        outer = (r[half] + np.swapaxes(r[half], 1, 2)) / 2 + np.eye(3)
        longest = np.linalg.norm(outer, axis=1).argmax(axis=1)
        axis = np.take_along_axis(outer, longest[:, None, None], axis=2)[..., 0]
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        axis *= np.where((axis * twice[half]).sum(axis=1) < 0, -1.0, 1.0)[:, None]
        result[half] = axis * angle[half, None]
    return result


def best_rotation(before, after):
    """(3, 3) the least-squares rotation of (n, 3) points to those after, both about their means (Kabsch)."""
    before, after = before - before.mean(axis=0), after - after.mean(axis=0)
    left, _, right = np.linalg.svd(after.T @ before)
    return left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))]) @ right
