# SPDX-License-Identifier: GPL-3.0-or-later
"""Transforms: rotations, the spaces of solves, and motions of rigid objects and bones."""

import functools
from dataclasses import dataclass

import numpy as np

from ..errors import UserError

# Rotations of a field at points, from its Jacobians.

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


# Solve space: the world up to a similarity, so that a moved or uniformly scaled object keeps its fit.
#
# Rigidity is judged in world space. An object's linear part L = U S Vᵀ splits into s·Q·P with the scale s,
# Q = U Vᵀ orthogonal (a mirror included) and P = V S Vᵀ / s the stretch that remains: local → solve is P,
# solve → world is s·Q and the location. Without non-uniform scale P is the identity.

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


# Motion of carried objects: rigid ones, and armatures by bone. Matrices are (4, 4), points (n, 3).


def rigid_motion_of(before, after):
    """The rigid motion that fits points to those after, by least squares."""
    motion = np.eye(4)
    motion[:3, :3] = best_rotation(before, after)
    motion[:3, 3] = after.mean(axis=0) - motion[:3, :3] @ before.mean(axis=0)
    return motion


def frame_points(size=1.0):
    """(7, 3) points for an object without geometry: its origin and the ends of its axes."""
    return size * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])


def turn_between(before, after):
    """(3, 3) the rotation closest to the map of one matrix's axes to the other's."""
    left, _, right = np.linalg.svd(after[:3, :3] @ np.linalg.inv(before[:3, :3]))
    return left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))]) @ right


BONE_POINTS = np.array([(0, 0, 0), (0, 1, 0), (0.5, 0, 0), (-0.5, 0, 0), (0, 0, 0.5), (0, 0, -0.5)])


def bone_points(poses, lengths):
    """(6 k, 3) points of k bones, posed by (k, 4, 4) matrices: head, tail, and four beside the head."""
    local = BONE_POINTS * np.asarray(lengths, dtype=np.float64)[:, None, None]
    return (np.einsum("kij,knj->kni", poses[:, :3, :3], local) + poses[:, None, :3, 3]).reshape(-1, 3)


def bone_poses(poses, before, after):
    """(k, 4, 4) poses of bones by their moved points: heads follow, bones point at their moved tails."""
    before, after = (points.reshape(-1, len(BONE_POINTS), 3) for points in (before, after))
    moved = poses.copy()
    for pose, one, other in zip(moved, before, after, strict=True):
        turn = best_rotation(one, other)
        turn = shortest_turn(turn @ (one[1] - one[0]), other[1] - other[0]) @ turn
        pose[:3, :3] = turn @ pose[:3, :3]
        pose[:3, 3] = other[0]
    return moved


def shortest_turn(a, b):
    """(3, 3) the smallest rotation from the direction of a to that of b."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -0.999999:  # nearly opposite: any perpendicular axis
        axis = np.cross(a, np.eye(3)[np.abs(a).argmin()])
        axis /= np.linalg.norm(axis)
        return 2 * np.outer(axis, axis) - np.eye(3)
    skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + skew + skew @ skew / (1 + cosine)


def posed(rest, parents, bases):
    """(k, 4, 4) poses of bones by their own transforms (`matrix_basis`); the inverse of `chained`."""
    poses = np.empty_like(bases)
    for index, parent in enumerate(parents):
        bound = rest[index] if parent < 0 else poses[parent] @ inverse(rest[parent]) @ rest[index]
        poses[index] = bound @ bases[index]
    return poses


def chained(rest, parents, targets, connected):
    """(k, 4, 4) own transforms (`matrix_basis`) that pose bones at these targets; parents come first.

    `rest` (k, 4, 4): rest bones, `parents`: their parents' indices or -1; a connected bone's head stays at
    its parent's tail, so that only its rotation is used.
    """
    posed, bases = np.empty_like(targets), np.empty_like(targets)
    for index, parent in enumerate(parents):
        bound = rest[index] if parent < 0 else posed[parent] @ inverse(rest[parent]) @ rest[index]
        bases[index] = inverse(bound) @ targets[index]
        if connected[index]:
            bases[index][:3, 3] = 0.0
        posed[index] = bound @ bases[index]
    return bases
