# SPDX-License-Identifier: GPL-3.0-or-later
"""An animation rendered in the window while its source is live: each frame shows what the viewport shows, and
the dependency graph of the render holds the source once."""

import bpy
import numpy as np
import scenes
import stage
from mouse import until

FIRST, LAST = 1, 5
AGREES = 1e-4  # of the bar: a frame's shape is the same whatever came before it


def checks(found, folder):
    for target in ("MODIFIER", "NEW"):
        yield from one(found, folder, target)


def set_stage(target):
    stage.empty_file()
    with stage.override():
        bar, _, moving = scenes.bar_with_handles()
        for frame, height in ((FIRST, 0.0), (LAST, 0.5)):
            moving.location.z = height
            moving.keyframe_insert("location", frame=frame)
        bar.arapfields.target = target
        scenes.activate(bar)
        scene = scenes.camera(240)
        scene.frame_set(FIRST)
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_all()
        bpy.ops.arapfields.live("INVOKE_DEFAULT")
    return bar, scene


def calm(bar):
    from addon.live import sessions

    yield 0.3
    yield from until(lambda: is_at_rest(sessions.live.get(bar.session_uid)), 30.0)
    yield 0.3


def is_at_rest(session):
    if session is None or session.worker is None or not session.worker.resting:
        return False
    return session.frames is None or not session.follows_animation or session.exact is not None


def one(found, folder, target):
    from addon.live import sessions

    bar, scene = set_stage(target)
    yield from calm(bar)
    name = "Bar" if target == "MODIFIER" else "Bar_live"
    viewport = {}
    for frame in range(FIRST, LAST + 1):
        scene.frame_set(frame)
        yield from calm(bar)
        viewport[frame] = stage.positions(name)
        stage.picture(folder, f"render-viewport-{target.lower()}-{frame}")
    rendered, meshes = {}, {}

    def note(scene, depsgraph):
        if depsgraph.mode == "RENDER":
            shown = [one.object for one in depsgraph.object_instances if one.object.type == "MESH"]
            meshes[scene.frame_current] = sorted(one.name for one in shown)
            for item in shown:
                rendered[scene.frame_current] = points_of(item)

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
    frames = sorted(rendered)
    both = [frame for frame in frames if same(rendered, viewport, frame)]
    away = {frame: round(float(np.abs(rendered[frame] - viewport[frame]).max()), 7) for frame in both}
    heights = [round(float(rendered[f][:, 2].max()), 3) for f in frames]
    found[f"render_{target}"] = {
        "frames": frames,
        "meshes_in_the_depsgraph": meshes,
        "each_once": bool(meshes) and all(len(names) == 1 for names in meshes.values()),
        "heights": heights,
        "frames_differ": bool(np.all(np.diff(heights) > 0.03)),
        "viewport_away": away,
        "agrees": len(away) == LAST - FIRST + 1 and max(away.values()) < AGREES,
        "still_live": sessions.is_live(bar),
    }
    with stage.override():
        sessions.end(bpy.context, bar)
    yield 0.3


def same(rendered, viewport, frame):
    return frame in viewport and rendered[frame].shape == viewport[frame].shape


def points_of(item):
    """(n, 3) vertices of an evaluated object, in the world."""
    flat = np.empty(3 * len(item.data.vertices), dtype=np.float32)
    item.data.vertices.foreach_get("co", flat)
    matrix = np.array(item.matrix_world)
    return flat.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
