# SPDX-License-Identifier: GPL-3.0-or-later
"""Short loops: frames there and back as an animated WebP, and the last frame as a picture of its own."""

import math
import tempfile
from pathlib import Path

import stage

from .workflows import snapshot

FRAMES, MILLISECONDS, REST = 12, 90, 400  # rendered, of one frame, of the ends
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
    return {"frames": frames, "bytes": encode(taken, output / f"{name}.webp")}


def encode(taken, path):
    """There and back, as good as fits in MOST; bytes."""
    order = [*taken, *taken[-2:0:-1]]
    wait = [MILLISECONDS] * len(order)
    wait[0] = wait[len(taken) - 1] = REST
    for quality in QUALITY:
        order[0].save(
            path, save_all=True, append_images=order[1:], duration=wait, loop=0, quality=quality, method=6
        )
        if path.stat().st_size <= MOST:
            break
    taken[-1].save(path.with_suffix(".jpg"), quality=86, optimize=True)
    return path.stat().st_size
