# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders an animation in the window while its source is live: each frame agrees with the viewport, and the
render's dependency graph contains the source once."""

import bpy
import numpy as np
import stage
from mouse import until
from support.blender import scenes

from addon.live import sessions

FIRST, LAST = 1, 5
SIZE, WIDTH = 240, 3.2  # width of a picture in pixels, and in world units
AGREES = 1.5 * WIDTH / SIZE  # one and a half pixels


def checks(figures, folder):
    for target in ("MODIFIER", "NEW"):
        yield from one(figures, folder, target)


def set_stage(target):
    stage.empty_file()
    with stage.override():
        bar, _, moving = scenes.bar_with_handles()
        for frame, height in ((FIRST, 0.0), (LAST, 0.5)):
            moving.location.z = height
            moving.keyframe_insert("location", frame=frame)
        bar.arapfields.result = target
        scenes.activate(bar)
        scene = scenes.camera(SIZE)
        scene.frame_set(FIRST)
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_all()
        bpy.ops.arapfields.live("INVOKE_DEFAULT")
    return bar, scene


def calm(bar):
    yield 0.3
    yield from until(lambda: is_at_rest(sessions.live.get(bar.session_uid)), 30.0)
    yield 0.3


def is_at_rest(session):
    if session is None or session.worker is None or not session.worker.is_settled:
        return False
    return session.playback.is_shown()


def one(figures, folder, target):
    bar, scene = set_stage(target)
    yield from calm(bar)
    name = "Bar" if target == "MODIFIER" else "Bar_live"
    viewport = {}
    for frame in range(FIRST, LAST + 1):
        scene.frame_set(frame)
        yield from calm(bar)
        viewport[frame] = stage.positions(name)
        stage.picture(folder, f"render-viewport-{target.lower()}-{frame}")
    meshes = {}

    def note(scene, depsgraph):
        if depsgraph.mode == "RENDER":
            shown = [one.object.name for one in depsgraph.object_instances if one.object.type == "MESH"]
            meshes[scene.frame_current] = sorted(shown)

    handlers = bpy.app.handlers.frame_change_post
    handlers.append(note)
    scene.frame_start, scene.frame_end = FIRST, LAST
    scene.render.filepath = str(folder / f"render-{target.lower()}-")
    ended = []
    bpy.app.handlers.render_complete.append(lambda *_: ended.append(True))
    with stage.override():
        bpy.ops.render.render("INVOKE_DEFAULT", animation=True)
    yield from until(lambda: ended, 240.0)
    yield 1.0
    handlers.remove(note)
    bpy.app.handlers.render_complete.pop()
    stage.tool("key", "Escape")
    yield 1.0
    frames = range(FIRST, LAST + 1)
    seen = [height_in(folder / f"render-{target.lower()}-{frame:04}.png") for frame in frames]
    expected = [float(viewport[frame][:, 2].max()) for frame in frames]
    away = float(np.abs(np.subtract(seen, expected)).max())
    figures[f"render_{target}"] = {
        "meshes_in_the_depsgraph": meshes,
        "each_once": len(meshes) == len(frames) and all(len(names) == 1 for names in meshes.values()),
        "heights_rendered": [round(height, 3) for height in seen],
        "heights_in_the_viewport": [round(height, 3) for height in expected],
        "frames_differ": bool(np.all(np.diff(seen) > 0.03)),
        "agrees": away < AGREES,
        "still_live": sessions.is_live(bar),
    }
    with stage.override():
        sessions.end(bpy.context, bar)
    yield 0.3


def height_in(path):
    """The height of the highest non-empty pixel of a picture, in world space."""
    image = bpy.data.images.load(str(path))
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    rows = np.flatnonzero((pixels.reshape(SIZE, SIZE, 4)[:, :, 3] > 0.5).any(axis=1))
    return (rows.max() + 1) / SIZE * WIDTH - WIDTH / 2
