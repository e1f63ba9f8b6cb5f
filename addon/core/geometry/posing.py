# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of carried objects: rigid ones, and armatures by bone. Matrices are (4, 4), points (n, 3)."""

import numpy as np

from .rotations import best_rotation
from .spaces import inverse


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
