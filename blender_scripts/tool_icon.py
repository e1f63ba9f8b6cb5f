# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the pin tool's toolbar icon and the list's anchor: python blender_scripts/tool_icon.py

Blender's format is coloured triangles: "VCO", a version, width and height, two zeros, then two bytes for each
corner's position (from the lower left), then four for its colour (red, green, blue, alpha).
"""

import itertools
import math
import struct
from pathlib import Path

from PIL import Image, ImageDraw

TARGET = Path(__file__).resolve().parents[1] / "addon/icons/pin.dat"
WHITE, GREY, ORANGE = (238, 238, 238, 255), (160, 160, 160, 255), (250, 154, 56, 255)


def disc(center, radii, colour, corners=28):
    """Triangles of an ellipse."""
    rim = [
        (center[0] + radii[0] * math.cos(a), center[1] + radii[1] * math.sin(a))
        for a in (2 * math.pi * i / corners for i in range(corners))
    ]
    return [((center, rim[i], rim[(i + 1) % corners]), colour) for i in range(corners)]


def picture():
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


def main():
    anchor().save(TARGET.with_name("anchor.png"), optimize=True)
    triangles = picture()
    places = b"".join(struct.pack("BB", round(x), round(y)) for corners, _ in triangles for x, y in corners)
    colours = b"".join(struct.pack("BBBB", *colour) * 3 for _, colour in triangles)
    TARGET.write_bytes(b"VCO\0" + struct.pack("BBBB", 255, 255, 0, 0) + places + colours)


if __name__ == "__main__":
    main()
