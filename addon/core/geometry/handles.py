# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles for the solver: boxes and motions in solve space, and boxes that follow the surface inside them."""

from dataclasses import dataclass

import numpy as np

from ..errors import UserError
from .edges import connected
from .spaces import best_rotation, inverse, rigid_motion

# Handles for the solver: boxes and motions in solve space.

PIN_SAMPLES = 12  # least number of surface samples that a pin holds, the nearest ones
FAR_SHARE = 0.5  # of the largest distance from all pins; points beyond are far
FAR_WEIGHT = 0.02  # weight with which far points stay in place, relative to a pin
REST_WEIGHT = 0.1  # weight with which points beyond a given distance stay
BONE_SHARE = 0.75  # a bone holds points nearer than this share of the distance to other bones: none at joints
BONE_LIMIT = 4.0  # in bone widths: distance within which a bone with few points takes the nearest ones
ANCHOR_TOLERANCE = 1e-5  # motion, relative to the box, below which a handle is an anchor
LEAST_VOLUME = 1e-6  # of a scaled box, relative to a cube of its longest side
MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])


@dataclass(frozen=True)
class Handle:
    """One handle in solve space. `rest` and `target` map the cube [-1, 1]³ onto the box."""

    name: str
    kind: str  # CUBE, POINT, GROUP, PIN, BONE or FAR
    rest: np.ndarray
    target: np.ndarray
    weights: np.ndarray | None = None  # GROUP, or BONE with a group: (n,) weights of vertices
    hold_from: float = 0.5  # vertices with at least this weight are held
    weight: float = 1.0  # weight in the energy, relative to other handles
    reach: float = 0.0  # range of influence, through the interior; 0: unlimited
    allow_scale: bool = False  # whether the motion may be any affine map that keeps the box's orientation
    centers: np.ndarray | None = None  # FAR: (k, 3) pins that its points are far from
    beyond: float = 0.0  # FAR: least distance; 0: FAR_SHARE of the largest

    @property
    def is_anchor(self):
        return np.array_equal(self.rest, self.target)

    def inside(self, points):
        """(n,) whether the points lie in the rest box."""
        return (np.abs(self._in_box(points)) <= 1).all(axis=1)

    def pinned(self, points, vertices, triangles):
        """Indices of the points that a pin holds: those in its ball that are connected with its place on the
        mesh there, or the nearest ones that are, if these are few. Splats have no triangles: all are."""
        local, corners = self._in_box(points), self._in_box(vertices)
        away = np.linalg.norm(local, axis=1)
        least = min(PIN_SAMPLES, len(points))
        reach = max(1.0, np.partition(away, least - 1)[least - 1])
        held, apart = np.zeros(0, dtype=np.int64), np.zeros(len(points), dtype=bool)
        for factor in (1, 2, 4):  # the part in the ball may have few points itself
            near = np.flatnonzero((away <= factor * reach) & ~apart)
            scale = 1 / (factor * reach)
            own = connected(scale * local[near], scale * corners, triangles)
            apart[near[~own]] = True
            held = near[own][np.argsort(away[near[own]], kind="stable")]
            if len(held) >= least:
                break
        if not len(held):
            held = away.argsort()[:1]
        return np.sort(held[: max((away[held] <= 1).sum(), least)])

    def by_weight(self, weights):
        """Indices of points with (n,) weights of at least `hold_from`; if a bone has none, the largest."""
        held = np.flatnonzero(weights >= self.hold_from)
        if len(held) or self.kind != "BONE":
            return held
        highest = np.argsort(-weights, kind="stable")[:PIN_SAMPLES]
        return np.sort(highest[weights[highest] > 0])

    def about_bone(self, points, handles):
        """Indices of points in the capsule around a bone that are much nearer to it than to other bones."""
        away = self._from_bone(points)
        bones = [handle for handle in handles if handle.kind == "BONE" and handle is not self]
        others = np.min([bone._from_bone(points) for bone in bones], axis=0) if bones else np.inf
        held = np.flatnonzero((away <= 1) & (away <= BONE_SHARE * others))
        if len(held) >= PIN_SAMPLES:
            return held
        away = np.where(away <= others, away, np.inf)
        nearest = np.argsort(away, kind="stable")[:PIN_SAMPLES]
        return np.sort(nearest[away[nearest] <= BONE_LIMIT])

    def _from_bone(self, points):
        """(n,) distances from the bone, the segment along the box's y axis, in widths of the box."""
        axes, from_center = self.rest[:3, :3], points - self.rest[:3, 3]
        half = axes[:, 1]
        along = np.clip(from_center @ half / (half @ half), -1.0, 1.0)
        width = np.sqrt(np.linalg.norm(axes[:, 0]) * np.linalg.norm(axes[:, 2]))
        return np.linalg.norm(from_center - along[:, None] * half, axis=1) / width

    def _in_box(self, points):
        return (points - self.rest[:3, 3]) @ np.linalg.inv(self.rest[:3, :3]).T


def box_matrix(matrix_world, size):
    """(4, 4) cube [-1, 1]³ → world, of an Empty with this display size."""
    return np.asarray(matrix_world, dtype=np.float64) @ np.diag([size, size, size, 1.0])


def solve_handle(name, kind, rest_local, world, now_world, space, **further):
    """A Handle from its rest box in the object's coordinates, and its present box in the world.

    `world`: (4, 4) matrix of the object; the rest box does not depend on it. `space` may be an earlier one.
    """
    to_solve, rest_world = space.world_to_solve, world @ rest_local
    rest = space.local_to_solve @ rest_local
    if abs(np.linalg.det(rest[:3, :3])) <= 1e-18 * np.abs(rest[:3, :3]).max() ** 3:
        raise UserError(
            "{name}: its box is flat; give the Empty a size and a scale other than zero", name=name
        )
    if np.linalg.det(rest[:3, :3]) < 0:
        rest = rest @ MIRROR  # the same box, right-handed
    if further.get("allow_scale"):
        motion = to_solve @ affine_motion(name, rest_world, now_world) @ space.solve_to_world
    else:
        mapped = to_solve @ rigid_motion(rest_world, now_world) @ space.solve_to_world
        motion = rigid_motion(np.eye(4), mapped)
        motion[:3, 3] += (mapped - motion)[:3] @ rest[:, 3]  # meets the box's center in a stretched space
    extent = np.linalg.norm(rest[:3, :3], axis=0).max()
    moved = np.abs(motion[:3, :3] - np.eye(3)).max() > ANCHOR_TOLERANCE
    shift = motion[:3, :3] @ rest[:3, 3] + motion[:3, 3] - rest[:3, 3]
    moved = moved or np.abs(shift).max() > ANCHOR_TOLERANCE * extent
    return Handle(name, kind, rest, motion @ rest if moved else rest.copy(), **further)


def affine_motion(name, rest, now):
    """(4, 4) affine map of one box to the other; UserError if it is singular or mirrors."""
    motion = now @ inverse(rest)
    linear = motion[:3, :3]
    if not np.isfinite(motion).all() or np.linalg.det(linear) <= LEAST_VOLUME * np.abs(linear).max() ** 3:
        raise UserError(
            "{name}: its scale flattens or mirrors what it holds; give every axis a scale above zero",
            name=name,
        )
    return motion


def require_held(counts):
    """`counts`: {handle name: number of samples}. UserError that names handles without samples."""
    empty = [name for name, count in counts.items() if count == 0]
    if empty:
        raise nothing_held(empty)


def nothing_held(names):
    """UserError that names handles without samples."""
    return UserError("No part of the surface lies in the rest region of {names}", names=", ".join(names))


def far_handle(centers, beyond):
    """FAR handle that anchors the region far from these (k, 3) pin centers."""
    weight = REST_WEIGHT if beyond else FAR_WEIGHT
    return Handle("", "FAR", np.eye(4), np.eye(4), weight=weight, centers=centers, beyond=beyond)


def far_from(handle, points):
    """Indices of the points that are far from a FAR handle's centers, in solve space at rest."""
    away = np.linalg.norm(points[:, None] - handle.centers, axis=2).min(axis=1)
    return np.flatnonzero(away >= (handle.beyond or FAR_SHARE * away.max()))


# Boxes of handles that follow the surface inside them.

LEAST = 12  # least number of surface points for a pin's motion: in its box, else the nearest ones
MOST_SCALE = 5.0  # largest scale of a side, and inverse of the smallest


def followed_box(box, before, after, is_box=True):
    """(4, 4) box with orthogonal axes that follows a surface, given by (n, 3) points before and after.

    It rotates with the points inside, and each side is scaled with them, so that it still contains them; an
    empty box stays. A pin's box follows the nearest points if it contains few, and keeps its size.
    """
    inside = (np.abs((before - box[:3, 3]) @ np.linalg.inv(box[:3, :3]).T) <= 1).all(axis=1)
    if is_box and not inside.any():
        return box
    if not is_box and inside.sum() < LEAST:
        inside = np.argsort(np.linalg.norm(before - box[:3, 3], axis=1), kind="stable")[:LEAST]
    before, after = before[inside], after[inside]
    turn = best_rotation(before, after)
    axes = box[:3, :3] / np.linalg.norm(box[:3, :3], axis=0)
    result = np.eye(4)
    result[:3, 3] = 0.0
    for k, (axis, turned) in enumerate(zip(axes.T, (turn @ axes).T, strict=True)):
        along, now, half, grown = before @ axis, after @ turned, np.linalg.norm(box[:3, k]), 1.0
        if is_box and np.ptp(along) > 1e-3 * half:
            grown = np.clip(np.ptp(now) / np.ptp(along), 1 / MOST_SCALE, MOST_SCALE)
        from_middle = box[:3, 3] @ axis - (along.min() + along.max()) / 2
        result[:3, 3] += ((now.min() + now.max()) / 2 + grown * from_middle) * turned
        result[:3, k] = grown * half * turned
    return result
