# SPDX-License-Identifier: GPL-3.0-or-later
"""Short loops as an animated WebP, there and back or round and round, and a frame as a picture of its own."""

import math
import tempfile
from pathlib import Path

import stage

from .workflows import snapshot

FRAMES, MILLISECONDS, REST = 10, 108, 400  # rendered, of one frame, of the ends
SAMPLES = 8  # a pixel: what moves hides what is left of the noise
MOST = 2_000_000  # bytes a loop
QUALITY = (92, 84, 72, 56)


def film(output, name, pose, width=440, frames=FRAMES):
    """Renders so many shares of the way, 0 to 1, posed by pose(share), eased at both ends; what to note."""
    from PIL import Image

    frames = 4 if stage.DRAFT else frames
    with tempfile.TemporaryDirectory() as folder:
        taken = []
        for frame in range(frames):
            pose((1 - math.cos(math.pi * frame / (frames - 1))) / 2)
            path = snapshot(Path(folder) / f"{frame}.png", width, SAMPLES)
            taken.append(Image.open(path).convert("RGB").copy())
    order = [*taken, *taken[-2:0:-1]]
    waits = [MILLISECONDS] * len(order)
    waits[0] = waits[frames - 1] = REST
    return {"frames": frames, "bytes": encode(order, waits, output / f"{name}.webp", taken[-1])}


def encode(order, waits, path, poster):
    """The frames, each for so many milliseconds, as good as fits in MOST, and one as a JPEG; bytes."""
    for quality in QUALITY:
        order[0].save(
            path, save_all=True, append_images=order[1:], duration=waits, loop=0, quality=quality, method=6
        )
        if path.stat().st_size <= MOST:
            break
    poster.save(path.with_suffix(".jpg"), quality=86, optimize=True)
    return path.stat().st_size
