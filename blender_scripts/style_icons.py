# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws addon/icons: the styles, the pin tool and the anchor. python blender_scripts/style_icons.py

A style is shown as the solid bounded by planes with the preferred normals, intersected with a ball.
"""

import itertools
import math
import struct
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import arapfields as af
from arapfields.cli.wrapping import png

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


# The pin has Blender's format for tools, coloured triangles: "VCO", a version, width and height, two zeros,
# then two bytes for each corner's position (from the lower left), then four for its colour (red, green, blue,
# alpha).
PIN = FOLDER / "pin.dat"
WHITE, GREY, ORANGE = (238, 238, 238, 255), (160, 160, 160, 255), (250, 154, 56, 255)


def disc(center, radii, colour, corners=28):
    """Triangles of an ellipse."""
    rim = [
        (center[0] + radii[0] * math.cos(a), center[1] + radii[1] * math.sin(a))
        for a in (2 * math.pi * i / corners for i in range(corners))
    ]
    return [((center, rim[i], rim[(i + 1) % corners]), colour) for i in range(corners)]


def pin():
    """A pin on a bent sheet: [((corner, corner, corner), colour)], coordinates from 0 to 255."""
    steps = [i / 16 for i in range(17)]
    sheet = [(20 + 215 * t, 52 + 46 * math.sin(math.pi * t)) for t in steps]
    found = []
    for (x0, y0), (x1, y1) in itertools.pairwise(sheet):
        lower, upper = [(x0, y0 - 15), (x1, y1 - 15)], [(x1, y1), (x0, y0)]
        found += [((*lower, upper[0]), GREY), ((lower[0], *upper), GREY)]
    found += [(((118, 170), (137, 170), (127.5, 92)), WHITE)]
    return found + disc((127.5, 194), (44, 44), ORANGE) + disc((114, 208), (12, 12), WHITE)


def anchor(size=64):
    """White strokes on a transparent background, as in Blender's icons."""
    image = Image.new("RGBA", (size, size))
    draw = ImageDraw.Draw(image)
    draw.ellipse((24, 3, 40, 19), outline=WHITE, width=5)
    draw.line((32, 18, 32, 58), fill=WHITE, width=6)
    draw.line((18, 27, 46, 27), fill=WHITE, width=5)
    draw.arc((8, 10, 56, 60), 10, 170, fill=WHITE, width=6)
    return image


def draw_pin_and_anchor():
    anchor().save(PIN.with_name("anchor.png"), optimize=True)
    triangles = pin()
    places = b"".join(struct.pack("BB", round(x), round(y)) for corners, _ in triangles for x, y in corners)
    colours = b"".join(struct.pack("BBBB", *colour) * 3 for _, colour in triangles)
    PIN.write_bytes(b"VCO\0" + struct.pack("BBBB", 255, 255, 0, 0) + places + colours)


def main():
    FOLDER.mkdir(exist_ok=True)
    draw_pin_and_anchor()
    for name in af.style_names():
        path = FOLDER / f"{name.replace(' ', '_')}.png"
        path.write_bytes(png(picture(af.preferred_normals(name))))
        print(path, path.stat().st_size)


if __name__ == "__main__":
    main()
