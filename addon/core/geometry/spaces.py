# SPDX-License-Identifier: GPL-3.0-or-later
"""Solve space: the world up to a similarity, so that a moved or uniformly scaled object keeps its fit.

Rigidity is judged in world space. An object's linear part L = U S Vᵀ splits into s·Q·P with the scale s,
Q = U Vᵀ orthogonal (a mirror included) and P = V S Vᵀ / s the stretch that remains: local → solve is P,
solve → world is s·Q and the location. Without non-uniform scale P is the identity.
"""

import functools
from dataclasses import dataclass

import numpy as np

from ..errors import UserError
from .rotations import best_rotation

UNIFORM_SCALE_TOLERANCE = 1e-5  # relative spread of the scales below which they count as equal
FLAT_SCALE_TOLERANCE = 1e-6  # smallest scale, relative to the largest
SAME_STRETCH = 1e-6  # tolerance for the rounding of a rotation in single precision
LEAST_MOVE = 1e-4  # of a shape's size: above the rounding errors of two objects that move together


@dataclass(frozen=True)
class Space:
    local_to_solve: np.ndarray  # (4, 4)
    solve_to_world: np.ndarray  # (4, 4), a similarity

    def to_solve(self, points):
        """(n, 3) local → solve."""
        return transform(self.local_to_solve, points)

    def to_local(self, points):
        """(n, 3) solve → local."""
        return transform(inverse(self.local_to_solve), points)

    def moved_to_local(self, after, before, local):
        """(n, 3) solve → local of points `after`, which were `before` in solve space and `local` locally.

        Points that have not moved are copied from `local`, as a round trip would change their last bits.
        """
        if np.array_equal(self.local_to_solve, np.eye(4)):
            return after
        result = self.to_local(after)
        still = (after == np.asarray(before, dtype=after.dtype)).all(axis=1)
        result[still] = local[still]
        return result

    def mirror(self, axis):
        """(4, 4) world → world reflection across the plane where that axis (0, 1, 2) of solve space is 0."""
        flip = np.eye(4)
        flip[axis, axis] = -1.0
        return self.solve_to_world @ flip @ self.world_to_solve

    def shifted(self, axis, offset):
        """This space with its origin moved by `offset` along an axis (0, 1, 2)."""
        shift = np.eye(4)
        shift[axis, 3] = offset
        return Space(inverse(shift) @ self.local_to_solve, self.solve_to_world @ shift)

    def is_like(self, other, noise=SAME_STRETCH):
        """Whether another space has the same stretch (non-uniform scale)."""
        return np.allclose(self.local_to_solve, other.local_to_solve, rtol=0.0, atol=noise)

    def as_at(self, first):
        """This space with the local → solve map of `first`, for an object whose stretch has changed since.

        The shape is solved as in `first` and stretched as a whole: solve → world is no similarity then.
        """
        if self.is_like(first):
            return self
        to_world = self.solve_to_world @ self.local_to_solve @ inverse(first.local_to_solve)
        return Space(first.local_to_solve, to_world)

    @property
    def world_to_solve(self):
        return inverse(self.solve_to_world)


def transform(matrix, points):
    """Applies a 4×4 affine matrix to (n, 3) points, in float64."""
    points = np.asarray(points, dtype=np.float64)
    if np.array_equal(matrix, np.eye(4)):
        return points.copy()
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def mirrors(matrix):
    """Whether a 4×4 affine matrix has a negative determinant."""
    return bool(np.linalg.det(matrix[:3, :3]) < 0.0)


def facing(triangles, matrix):
    """(m, 3) triangles with flipped winding if the matrix mirrors, so that they face the same way."""
    return triangles[:, ::-1] if mirrors(matrix) else triangles


def inverse(matrix):
    """The inverse of a 4×4 affine matrix; LinAlgError if it is singular.

    By cofactors: NumPy's solver starts its threads even for this, which takes milliseconds on a busy machine.
    """
    (a, b, c), (d, e, f), (g, h, i) = matrix[:3, :3].tolist()
    cofactors = (
        (e * i - f * h, c * h - b * i, b * f - c * e),
        (f * g - d * i, a * i - c * g, c * d - a * f),
        (d * h - e * g, b * g - a * h, a * e - b * d),
    )
    determinant = sum(x * row[0] for x, row in zip((a, b, c), cofactors, strict=True))
    if determinant == 0.0:
        raise np.linalg.LinAlgError("a matrix that flattens has no inverse")
    result = np.eye(4)
    result[:3, :3] = np.array(cofactors) / determinant
    result[:3, 3] = -(result[:3, :3] * matrix[:3, 3]).sum(axis=1)
    return result


def space_of(matrix_world, name="object"):
    """The solve space of an object with this world matrix; UserError if its scale is singular."""
    world = np.asarray(matrix_world, dtype=np.float64)
    if not np.isfinite(world).all():
        raise UserError("{name}: its transform is not valid", name=name)
    left, scales, right = np.linalg.svd(world[:3, :3])
    if scales[-1] <= FLAT_SCALE_TOLERANCE * scales[0]:
        raise UserError("{name}: its scale flattens it; give every axis a scale other than zero", name=name)
    if scales[0] - scales[-1] <= UNIFORM_SCALE_TOLERANCE * scales[0]:
        return Space(np.eye(4), world)
    scale = float(np.prod(scales) ** (1 / 3))
    local_to_solve, solve_to_world = np.eye(4), np.eye(4)
    local_to_solve[:3, :3] = right.T @ np.diag(scales / scale) @ right
    solve_to_world[:3, :3] = scale * (left @ right)
    solve_to_world[:3, 3] = world[:3, 3]
    return Space(local_to_solve, solve_to_world)


def unflattened(matrix):
    """The matrix; if it is singular, axes of scale 0 get the scale of the longest one, or 1.

    For frames at which an animated scale is 0: nothing is visible there, so any scale will do.
    """
    left, scales, right = np.linalg.svd(matrix[:3, :3])
    lost = scales <= FLAT_SCALE_TOLERANCE * scales[0]
    if not lost.any():
        return matrix
    scales[lost] = scales[0] or 1.0
    scales[-1] *= np.sign(np.linalg.det(left @ right))
    result = matrix.copy()
    result[:3, :3] = left @ np.diag(scales) @ right
    return result


def pose(matrix):
    """The rigid part of a 4×4 matrix: its closest orthogonal linear part and its translation."""
    matrix = np.asarray(matrix, dtype=np.float64)
    left, _, right = np.linalg.svd(matrix[:3, :3])
    result = np.eye(4)
    result[:3, :3] = left @ right
    result[:3, 3] = matrix[:3, 3]
    return result


def similarity(before, after):
    """(4, 4) the least-squares similarity, without reflection, of (n, 3) points to those after."""
    turn = best_rotation(before, after)
    middles = before.mean(axis=0), after.mean(axis=0)
    turned, moved = (before - middles[0]) @ turn.T, after - middles[1]
    result = np.eye(4)
    result[:3, :3] = turn * ((turned * moved).sum() / (turned**2).sum())
    result[:3, 3] = middles[1] - result[:3, :3] @ middles[0]
    return result


def upright(turn):
    """(3, 3) axes, as columns, upright in the world, with the heading of an object with this (3, 3) rotation.

    z is the world's up; x is horizontal along the object's x, or along its y if x is vertical.
    """
    heading = turn[:, 1 if np.abs(turn[2]).argmax() == 0 else 0] * [1.0, 1.0, 0.0]
    x = heading / np.linalg.norm(heading)
    return np.stack([x, np.cross([0.0, 0.0, 1.0], x), [0.0, 0.0, 1.0]], axis=1)


def rigid_motion(rest, target):
    """(4, 4) the rigid motion, without reflection, of one matrix's pose to the other's; scale is ignored."""
    return _rigid_motion(
        *(np.asarray(matrix, dtype=np.float64).tobytes() for matrix in (rest, target))
    ).copy()


@functools.lru_cache(maxsize=4096)
def _rigid_motion(rest, target):
    """rigid_motion of the matrices' bytes, for the cache: live mode reads handles at rest again and again."""
    rest, target = (np.frombuffer(matrix).reshape(4, 4) for matrix in (rest, target))
    motion = pose(target) @ inverse(pose(rest))
    left, _, right = np.linalg.svd(motion[:3, :3])
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    motion[:3, :3] = left @ mirror @ right
    motion[:3, 3] = target[:3, 3] - motion[:3, :3] @ rest[:3, 3]
    return motion


def is_in_place(points, before):
    """Whether points (n, 3) are unchanged, up to the rounding of objects that move together."""
    return np.abs(points - before).max() <= LEAST_MOVE * np.ptp(before, axis=0).max()
