# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles as the solver wants them: boxes and motions in solve space."""

from dataclasses import dataclass

import numpy as np

from ..errors import UserError
from .spaces import inverse, rigid_motion

PIN_SAMPLES = 12  # of the surface that a pin holds at least: those nearest to it
FAR_SHARE = 0.5  # of the largest distance from all pins: what is farther is far
FAR_WEIGHT = 0.02  # with which what is far holds its place, relative to a pin
REST_WEIGHT = 0.1  # with which the rest is kept
BONE_SHARE = 0.75  # of the distance to any other bone, within which a bone holds: at joints none does
BONE_LIMIT = 4.0  # widths within which a bone that holds little takes the nearest of its side
ANCHOR_TOLERANCE = 1e-5  # motion, relative to the box, below which a handle is an anchor
LEAST_VOLUME = 1e-6  # of a box that may scale, relative to a cube as long as its longest side
MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])


@dataclass(frozen=True)
class Handle:
    """One handle in solve space. `rest` and `target` map the cube [-1, 1]³ onto the box."""

    name: str
    kind: str  # CUBE, POINT, GROUP, PIN, BONE or FAR
    rest: np.ndarray
    target: np.ndarray
    weights: np.ndarray | None = None  # GROUP, and BONE that has one: (n,) of the source's vertices
    hold_from: float = 0.5  # weight from which they hold
    weight: float = 1.0  # how strictly it is followed, relative to others
    reach: float = 0.0  # how far it moves things, through the inside; 0: everything
    allow_scale: bool = False  # whether the motion may be any affine map that keeps the box's orientation
    centers: np.ndarray | None = None  # FAR: (k, 3) from which it is far
    beyond: float = 0.0  # FAR: how far; 0: a share of the largest distance

    @property
    def is_anchor(self):
        return np.array_equal(self.rest, self.target)

    def inside(self, points):
        """(n,) whether the points lie in the rest box."""
        return (np.abs(self._in_box(points)) <= 1).all(axis=1)

    def pinned(self, points):
        """Indices of the points that a pin holds: those in its ball, the nearest ones where these are few."""
        away = (self._in_box(points) ** 2).sum(axis=1)
        count = max(int((away <= 1).sum()), min(PIN_SAMPLES, len(points)))
        return np.sort(np.argpartition(away, count - 1)[:count])

    def by_weight(self, weights):
        """Indices of the points that these (n,) weights hold; of a bone whose are all lower, the highest."""
        held = np.flatnonzero(weights >= self.hold_from)
        if len(held) or self.kind != "BONE":
            return held
        highest = np.argsort(-weights, kind="stable")[:PIN_SAMPLES]
        return np.sort(highest[weights[highest] > 0])

    def about_bone(self, points, handles):
        """Indices of the points in the capsule along a bone that are much nearer to it than to others."""
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
        """(n,) distances from the line along the box's y axis, in widths of the box."""
        axes, from_center = self.rest[:3, :3], points - self.rest[:3, 3]
        half = axes[:, 1]
        along = np.clip(from_center @ half / (half @ half), -1.0, 1.0)
        width = np.sqrt(np.linalg.norm(axes[:, 0]) * np.linalg.norm(axes[:, 2]))
        return np.linalg.norm(from_center - along[:, None] * half, axis=1) / width

    def _in_box(self, points):
        return (points - self.rest[:3, 3]) @ np.linalg.inv(self.rest[:3, :3]).T


def box_matrix(matrix_world, size):
    """The cube [-1, 1]³ → world, of an Empty drawn with this size."""
    return np.asarray(matrix_world, dtype=np.float64) @ np.diag([size, size, size, 1.0])


def solve_handle(name, kind, rest_local, world, now_world, space, **further):
    """A handle from its box at rest in the object's coordinates, and its box now in the world.

    The rest does not depend on where the object is, which `world`, (4, 4), says; `space` may be earlier.
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
        motion[:3, 3] += (mapped - motion)[:3] @ rest[:, 3]  # where the space is stretched, the middle is met
    extent = np.linalg.norm(rest[:3, :3], axis=0).max()
    moved = np.abs(motion[:3, :3] - np.eye(3)).max() > ANCHOR_TOLERANCE
    shift = motion[:3, :3] @ rest[:3, 3] + motion[:3, 3] - rest[:3, 3]
    moved = moved or np.abs(shift).max() > ANCHOR_TOLERANCE * extent
    return Handle(name, kind, rest, motion @ rest if moved else rest.copy(), **further)


def affine_motion(name, rest, now):
    """(4, 4) the map that takes one box to the other; UserError where it flattens or mirrors."""
    motion = now @ inverse(rest)
    linear = motion[:3, :3]
    if not np.isfinite(motion).all() or np.linalg.det(linear) <= LEAST_VOLUME * np.abs(linear).max() ** 3:
        raise UserError(
            "{name}: its scale flattens or mirrors what it holds; give every axis a scale above zero",
            name=name,
        )
    return motion


def require_held(counts):
    """`counts`: samples by handle name. UserError that names the handles that hold none."""
    empty = [name for name, count in counts.items() if count == 0]
    if empty:
        raise nothing_held(empty)


def nothing_held(names):
    """The UserError that names handles which hold nothing."""
    return UserError("No part of the surface lies in the rest region of {names}", names=", ".join(names))


def far_handle(centers, beyond):
    """What is far from these (k, 3) centers holds its place: an anchor for all that no pin moves."""
    weight = REST_WEIGHT if beyond else FAR_WEIGHT
    return Handle("", "FAR", np.eye(4), np.eye(4), weight=weight, centers=centers, beyond=beyond)


def far_from(handle, points):
    """Indices of the points that are far from a FAR handle's centers, in solve space at rest."""
    away = np.linalg.norm(points[:, None] - handle.centers, axis=2).min(axis=1)
    return np.flatnonzero(away >= (handle.beyond or FAR_SHARE * away.max()))
