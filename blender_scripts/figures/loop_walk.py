# SPDX-License-Identifier: GPL-3.0-or-later
"""The walk of its page, without and with secondary motion, side by side; and four of its frames."""

import math
import tempfile
from pathlib import Path

import bpy
import stage
import walking

from .common import stack
from .looping import SAMPLES, encode
from .workflows import followed, in_examples, snapshot

STEP = 2  # of its frames each that is shown


def caption(text):
    """Before the feet, towards the camera; above the floor, so that it has no shadow in it."""
    turn = bpy.context.scene.camera.rotation_euler.z
    made = stage.caption(text, (0.8 * math.sin(turn), -0.8 * math.cos(turn), 0.01), 0.16)
    made.rotation_euler.z = turn
    return made


def cycle(folder, name, text):
    """A picture for each frame of the last cycle, taken in `folder`."""
    words = caption(text)
    frames = range(walking.LAST - walking.CYCLE + 1, walking.LAST + 1, STEP * (4 if stage.DRAFT else 1))
    paths = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        if name == "plain":
            bpy.ops.arapfields.deform()
        paths.append(snapshot(Path(folder) / f"{name}-{frame}.png", 300, SAMPLES))
    bpy.data.objects.remove(words)
    return paths


def still(output, frames=(51, 57, 63, 69)):
    paths = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        paths.append(snapshot(output / f"walk-{frame}.png", 360))
    stack(paths, output / "workflow-walk.png", gap=0, horizontal=True)


def loop(output):
    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        followed("walk")
        still(output)
        swinging = cycle(folder, "swinging", "secondary motion")
        bpy.ops.wm.open_mainfile(filepath="out/examples/walk.blend")
        plain = cycle(folder, "plain", "handles alone")
        taken = []
        for pair in zip(plain, swinging, strict=True):
            stack(pair, Path(folder) / "pair.png", gap=0, horizontal=True)
            taken.append(Image.open(Path(folder) / "pair.png").convert("RGB").copy())
    waits = [STEP * 1000 // 24] * len(taken)  # as it plays in Blender; around, so the last leads to the first
    size = encode(taken, waits, output / "loop-walk.webp", taken[0])
    return {"frames": len(taken), "bytes": size}


def render(output):
    return in_examples(lambda: loop(output.resolve()))
