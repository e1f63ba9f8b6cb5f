# SPDX-License-Identifier: GPL-3.0-or-later
"""Helpers of the checks in Blender's window: mouse and keys by xdotool, positions, pictures, judgements."""

import contextlib
import json
import os
import subprocess
import time
import traceback

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector
from support.blender import scenes
from verdicts import BEGUN, JUDGED, failures

import addon
from addon.core.runtime import jobs
from addon.live import sessions
from addon.names import PROPERTY
from addon.pin_tool.hover import hover as hovering

# Moves the mouse over the 3D view by xdotool; waits for conditions, as the machine may be busy.


def pixel(point):
    """Screen coordinates in pixels of a point in world space; the window fills the screen."""
    window, area, region = view()
    spot = location_3d_to_region_2d(region, area.spaces.active.region_3d, Vector(point))
    return round(region.x + spot.x), round(window.height - region.y - spot.y)


def click(spot, button=1, pause=0.6):
    yield from move(spot[0] - 3, spot[1])
    yield from move(*spot)
    tool("click", button)
    yield pause


def keys(*names, pause=0.4):
    for name in names:
        tool("key", name)
        yield pause


def move(x, y, pause=0.3):
    tool("mousemove", x, y)
    yield pause


def hover(spot):
    yield from move(spot[0] - 4, spot[1], pause=0.2)
    yield from move(*spot)


def until(reached, limit=20.0, sign=lambda: None):
    """Waits until a condition holds, at most `limit` seconds since `sign()` last changed."""
    begin, seen = time.perf_counter(), sign()
    while not reached() and time.perf_counter() - begin < limit:
        yield 0.02
        if sign() != seen:
            begin, seen = time.perf_counter(), sign()
    yield 0.05


def until_idle(limit=60.0):
    """Waits until no job runs, or a job has made no progress for `limit` seconds."""
    yield from until(lambda: jobs.running() is None, limit, jobs.progress)


def until_live_rests(limit=30.0):
    """Waits until the live shapes, if any, are refined and shown."""
    yield 0.1
    yield from until(lambda: all(s.worker and s.worker.is_settled for s in sessions.live.values()), limit)
    yield 0.1


def is_followed():
    """Whether the shape has reached the dragged handle."""
    return all(s.worker is not None and s.worker.wait(0.0) for s in sessions.live.values())


def is_dragging():
    return hovering.drag is not None


def release():
    """Releases the button, and waits until the shape is at rest."""
    tool("mouseup", 1)
    yield 0.1
    yield from until(lambda: not is_dragging())
    yield 0.2


def drag(start, end, steps=8, pause=0.05, hold=False):
    """Presses the button at one pixel, moves to another, and releases it there unless `hold`."""
    yield from hover(start)
    tool("mousedown", 1)
    yield from until(is_dragging, 3.0)
    for step in range(1, steps + 1):
        share = step / steps
        tool("mousemove", *(round(a + share * (b - a)) for a, b in zip(start, end, strict=True)))
        yield pause
    yield 0.2
    yield from until(is_followed)
    if not hold:
        yield from release()


# Helpers of the checks in Blender's window: positions, pictures, judgements.

PATIENCE = float(os.environ.get("ARAPFIELDS_PATIENCE", "1"))  # factor of the pauses, for a busy machine
TAB = (1299, 340)  # the sidebar's last tab in a window of 1600 × 1000
LEAST = 100  # pixels of an open sidebar; tabs alone are narrower


def start(steps, names, folder):
    """Runs the generator `steps(found, folder)`, which yields pauses in seconds, beside Blender's events,
    with the add-on registered unless it is installed. Prints failures, and quits Blender with an exit code.
    """
    figures = {}
    bpy.context.preferences.view.show_splash = False
    folder.mkdir(parents=True, exist_ok=True)
    if not hasattr(bpy.types.Object, PROPERTY):
        addon.register()
    sequence = steps(figures, folder)

    def drive():
        try:
            return PATIENCE * next(sequence)
        except StopIteration:
            pass
        except Exception:
            figures["error"] = traceback.format_exc()
        end(figures, names, folder)
        return None

    bpy.app.timers.register(drive, first_interval=1.0, persistent=True)


def end(figures, names, folder):
    """Judges the part that an error ended, or those not yet judged, and quits Blender."""
    before = judged(folder)
    ended = [name for name in names if before.get(name) == BEGUN] or names[-1:]
    left = [name for name in names if before.get(name) in (None, BEGUN)]
    for name in ended if "error" in figures else left:
        judge(figures, name, folder)
    path = folder / "checks.json"
    former = json.loads(path.read_text()) if path.exists() else {}
    path.write_text(json.dumps(former | figures, indent=1))
    if any(judged(folder).values()):
        os._exit(1)  # quit_blender() gives no exit code
    bpy.ops.wm.quit_blender()


def judged(folder):
    """{part: lines of failures} of the parts that have begun."""
    path = folder / JUDGED
    return json.loads(path.read_text()) if path.exists() else {}


def judge(figures, name, folder):
    record(name, failures(figures, [name]), folder)
    print("\n".join(f"WRONG {line}" for line in judged(folder)[name]) or f"{name}: as expected", flush=True)


def record(name, lines, folder):
    (folder / JUDGED).write_text(json.dumps(judged(folder) | {name: lines}, indent=1))


def view():
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == "VIEW_3D")
    return window, area, next(r for r in area.regions if r.type == "WINDOW")


def override():
    window, area, region = view()
    return bpy.context.temp_override(window=window, area=area, region=region)


def show_sidebar():
    with override():
        bpy.context.area.spaces.active.show_region_ui = True
        for region in bpy.context.area.regions:
            if region.type == "UI":
                with contextlib.suppress(AttributeError):  # read-only in some versions
                    region.active_panel_category = "ARAP Fields"


def open_sidebar():
    """Shows the sidebar and clicks the panel's tab, if the window is large enough; a second click would hide
    the panel."""
    show_sidebar()
    yield 1.5
    if view()[0].width > TAB[0] and not is_panel_seen():
        tool("mousemove", *TAB, "click", 1)
    yield 1.0


def is_panel_seen():
    region = next(one for one in view()[1].regions if one.type == "UI")
    return region.width > LEAST and region.active_panel_category == "ARAP Fields"


def look():
    with override():
        eye = bpy.context.area.spaces.active.region_3d
    return eye.view_perspective, eye.view_rotation.copy()


def as_at_first(first):
    """Restores one window with the view `first` of the bar and its handles, Blender's default tool, and the
    visible panel."""
    for window in bpy.context.window_manager.windows[1:]:
        with bpy.context.temp_override(window=window):
            bpy.ops.wm.window_close()
    with override():
        bpy.ops.wm.tool_set_by_id(name="builtin.select_box")
        eye = bpy.context.area.spaces.active.region_3d
        eye.view_perspective, eye.view_rotation = first
        bpy.context.preferences.system.viewport_aa = "OFF"  # drawing by the processor is slow
        if bpy.context.object and bpy.context.object.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        empty_file()
        scenes.bar_with_handles()
        bpy.ops.view3d.view_all()
    yield from open_sidebar()


def tool(*words):
    subprocess.run(["xdotool", *map(str, words)], check=False)


def picture(folder, name, part=None):
    """Takes a picture of the screen, or of a part: left, top, width, height."""
    crop = ["-crop", "{2}x{3}+{0}+{1}".format(*part), "+repage"] if part else []
    subprocess.run(["import", "-window", "root", *crop, str(folder / f"{name}.png")], check=False)


def empty_file():
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)


def positions(name):
    return scenes.world_points(bpy.data.objects[name])


def everything():
    """Names of all data-blocks, and positions of all meshes, for comparison bit by bit."""
    names = {
        kind: sorted(getattr(bpy.data, kind).keys())
        for kind in ("objects", "meshes", "collections", "actions", "materials", "shape_keys")
    }
    points = {}
    for mesh in list(bpy.data.meshes):
        flat = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", flat)
        points[mesh.name] = flat.tobytes()
    where = {o.name: [tuple(row) for row in o.matrix_world] for o in bpy.data.objects}
    return names, points, where
