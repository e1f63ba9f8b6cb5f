# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws addon/icons/*.png, the icons of styles: python blender_scripts/style_icons.py

Each shows the solid bounded by planes with the preferred normals, intersected with a ball.
"""

from pathlib import Path

import numpy as np

import arapfields as af
from arapfields.cli.contact_sheet import png

FOLDER = Path(__file__).resolve().parents[1] / "addon" / "icons"
SIZE, FINER = 64, 4
BALL = 3.2
VIEW = np.array([[0.80, 0.60, 0.0], [-0.27, 0.36, 0.89], [0.535, -0.71, 0.45]])
LOW, HIGH = np.array([0.16, 0.25, 0.42]), np.array([0.98, 0.72, 0.38])
LIGHT = np.array([-0.45, 0.65, 0.62])


def solid(normals, points, direction):
    """Normals at the points where rays enter {x: normals·x ≤ 1, |x| ≤ BALL}; NaN for rays that miss it."""
    along, offset = normals @ direction, points @ normals.T
    with np.errstate(divide="ignore", invalid="ignore"):
        times = (1.0 - offset) / along
    enters = np.where(along < -1e-9, times, -np.inf)
    leaves = np.where(along > 1e-9, times, np.inf).min(axis=1)
    beside = ((np.abs(along) <= 1e-9) & (offset > 1.0)).any(axis=1)
    middle = points @ direction
    reach = BALL**2 - (points**2).sum(axis=1) + middle**2
    ball_in = -middle - np.sqrt(np.maximum(reach, 0))
    leaves = np.minimum(leaves, -middle + np.sqrt(np.maximum(reach, 0)))
    face, first = enters.argmax(axis=1), enters.max(axis=1)
    ball = ball_in > first
    enter = np.maximum(first, ball_in)
    found = np.where(ball[:, None], (points + enter[:, None] * direction) / BALL, normals[face])
    found[(enter > leaves) | beside | (reach < 0)] = np.nan
    return found


def extent(normals, view):
    """Largest distance of the solid from the center of the picture."""
    grid = np.linspace(-BALL, BALL, 81)
    x, y = (part.reshape(-1, 1) for part in np.meshgrid(grid, grid))
    seen = np.isfinite(solid(normals, x * view[0] + y * view[1] + 5.0 * view[2], -view[2])[:, 0])
    return np.abs(np.concatenate([x[seen], y[seen]])).max()


def picture(normals):
    """(SIZE, SIZE, 4) uint8 image of a style."""
    view = VIEW / np.linalg.norm(VIEW, axis=1, keepdims=True)
    count = SIZE * FINER
    width = 1.1 * extent(normals, view)
    x, y = np.meshgrid(np.linspace(-width, width, count), np.linspace(width, -width, count))
    points = x.reshape(-1, 1) * view[0] + y.reshape(-1, 1) * view[1] + 5.0 * view[2]
    seen = solid(normals, points, -view[2])
    light = (LIGHT / np.linalg.norm(LIGHT)) @ view
    shade = np.clip(seen @ light, 0, 1)[:, None] * 0.85 + 0.15
    colour = np.nan_to_num(LOW + (HIGH - LOW) * shade)
    alpha = np.isfinite(seen[:, :1]).astype(float)
    whole = (
        np.concatenate([colour * alpha, alpha], axis=1).reshape(SIZE, FINER, SIZE, FINER, 4).mean(axis=(1, 3))
    )
    whole[..., :3] /= np.maximum(whole[..., 3:], 1e-6)
    return np.round(255 * np.clip(whole, 0, 1)).astype(np.uint8)


def main():
    FOLDER.mkdir(exist_ok=True)
    for name in af.style_names():
        path = FOLDER / f"{name.replace(' ', '_')}.png"
        path.write_bytes(png(picture(af.preferred_normals(name))))
        print(path, path.stat().st_size)


if __name__ == "__main__":
    main()
