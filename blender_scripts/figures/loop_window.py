# SPDX-License-Identifier: GPL-3.0-or-later
"""The pin page's steps done by mouse in Blender's window, as tests/gui/film.py records them.

The pictures of the screen lack the cursor: an arrow is drawn where it was.
"""

import json
import tempfile
from pathlib import Path

import windowed

from .looping import encode
from .workflows import in_examples

VIEW = (0, 27, 722, 555)  # of the window: the viewport with its toolbar
WIDTH = 600
WAIT = 90  # milliseconds, times what a frame is to be held
ARROW = ((0, 0), (0, 22), (5, 17), (9, 26), (13, 24), (9, 16), (16, 16))


def with_cursor(picture, spot, pressed):
    from PIL import ImageDraw

    drawing = ImageDraw.Draw(picture)
    if pressed:
        drawing.ellipse([spot[0] - 9, spot[1] - 9, spot[0] + 9, spot[1] + 9], outline="white", width=2)
    arrow = [(spot[0] + x, spot[1] + y) for x, y in ARROW]
    drawing.polygon(arrow, fill="white", outline="black")
    return picture


def loop(output):
    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        film = Path(folder) / "film"
        windowed.record("out/examples/pins.blend", film)
        found = json.loads((film / "checks.json").read_text())
        if "error" in found:
            raise RuntimeError(found["error"])
        frames, taken = json.loads((film / "film.json").read_text()), []
        for number, frame in enumerate(frames):
            picture = Image.open(film / f"{number:03}.png").convert("RGB")
            picture = with_cursor(picture, frame["cursor"], frame["pressed"]).crop(VIEW)
            height = round(WIDTH * picture.height / picture.width)
            taken.append(picture.resize((WIDTH, height), Image.Resampling.LANCZOS))
    waits = [WAIT * frame["hold"] for frame in frames]
    size = encode(taken, waits, output / "loop-window.webp", taken[-1])
    return {"frames": len(taken), "bytes": size, "pins": len(found["pins"]), "moved": found["moved"]}


def render(output):
    return in_examples(lambda: loop(output.resolve()))
