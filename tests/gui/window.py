# SPDX-License-Identifier: GPL-3.0-or-later
"""Run by a real Blender with a window: jobs are modal, tick, cancel and undo. docs/development.md says how.

blender --factory-startup --python tests/gui/window.py -- OUTPUT_FOLDER
Writes checks.json, and pictures where ImageMagick's `import` is at hand.
"""

import contextlib
import json
import subprocess
import sys
import time
import traceback
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
OUTPUT = Path(sys.argv[sys.argv.index("--") + 1])
sys.path[:0] = [str(ROOT), str(ROOT / "tests/blender")]

import scenes  # noqa: E402

import addon  # noqa: E402

FOUND = {}
LONG = {**scenes.QUICK, "iterations": 20000}
TAB = (1299, 340)  # where the sidebar's last tab lies in a window of 1600 × 1000


def override():
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == "VIEW_3D")
    region = next(r for r in area.regions if r.type == "WINDOW")
    return bpy.context.temp_override(window=window, area=area, region=region)


def picture(name):
    subprocess.run(["import", "-window", "root", str(OUTPUT / f"{name}.png")], check=False)


def show_sidebar():
    with override():
        bpy.context.area.spaces.active.show_region_ui = True
        for region in bpy.context.area.regions:
            if region.type == "UI":
                with contextlib.suppress(AttributeError):  # read-only in some versions
                    region.active_panel_category = "ARAP Fields"


def positions(name):
    return scenes.world_points(bpy.data.objects[name])


def invoke(settings):
    with override():
        scenes.activate(bpy.data.objects["Bar"])
        return str(bpy.ops.arapfields.deform("INVOKE_DEFAULT", **settings))


def until_idle(limit):
    from addon.core import jobs

    begin = time.perf_counter()
    while jobs.running() is not None and time.perf_counter() - begin < limit:
        yield 0.01


def steps():
    """Yields seconds to wait; between them Blender's event loop runs."""
    from addon.core import jobs

    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    with override():
        _, _, moving = scenes.bar_with_handles()
        bpy.ops.view3d.view_all()
    show_sidebar()
    yield 1.5
    subprocess.run(["xdotool", "mousemove", *map(str, TAB), "click", "1"], check=False)
    yield 1.5
    picture("panel")
    moving.location.z += 0.5
    bpy.context.view_layer.update()
    before = positions("Bar")
    bpy.ops.ed.undo_push(message="before")

    FOUND["invoke"] = invoke(LONG)
    late, begin, last = 0.0, time.perf_counter(), time.perf_counter()
    while time.perf_counter() - begin < 3.0:
        yield 0.01
        late, last = max(late, time.perf_counter() - last - 0.01), time.perf_counter()
    FOUND["running"], FOUND["progress"] = jobs.running() is not None, jobs.progress()
    FOUND["longest_stall_s"] = late
    picture("running")

    begin = time.perf_counter()
    bpy.ops.arapfields.cancel()
    yield from until_idle(10)
    FOUND["cancel_s"] = time.perf_counter() - begin
    FOUND["exact_after_cancel"] = bool(np.array_equal(positions("Bar"), before))
    FOUND["objects_after_cancel"] = sorted(o.name for o in bpy.data.objects)
    yield 0.5
    picture("cancelled")

    invoke(scenes.QUICK)
    yield from until_idle(60)
    modal = positions("Bar_deformed")
    yield 0.5
    picture("result")
    FOUND["one_undo_step"] = undo_removes_the_result()
    with override():
        scenes.activate(bpy.data.objects["Bar"])
        bpy.ops.arapfields.deform("EXEC_DEFAULT", **scenes.QUICK)
    FOUND["modal_against_blocking"] = float(np.abs(positions("Bar_deformed") - modal).max())

    yield from live_rate()

    invoke(LONG)
    yield 0.5
    FOUND["running_before_load"] = jobs.running() is not None
    bpy.ops.wm.read_homefile(use_empty=True)
    FOUND["running_after_load"] = jobs.running() is not None
    yield 1.0
    addon.unregister()
    FOUND["disabled"] = not hasattr(bpy.types.Object, "arapfields")


def live_rate():
    """Drags a handle of a mesh of 50,000 vertices: how often the viewport shows a new shape."""
    from addon.bridge import live

    with override():
        for name in ("Bar_deformed",):
            bpy.data.objects.remove(bpy.data.objects[name])
        bar, moving = bpy.data.objects["Bar"], bpy.data.objects["Moving"]
        scenes.activate(bar)
        bar.modifiers.new("Subdivision", "SUBSURF").levels = 3
        bpy.context.view_layer.update()
        begin = time.perf_counter()
        bpy.ops.arapfields.live()
        FOUND["live_setup_s"] = time.perf_counter() - begin
    bar.hide_set(True)
    FOUND["live_vertices"] = len(bpy.data.objects["Bar_deformed"].data.vertices)
    shown = []
    original = live.Session.show
    live.Session.show = lambda self: original(self) and (shown.append(time.perf_counter()) or True)
    begin = time.perf_counter()
    while time.perf_counter() - begin < 5.0:
        share = (time.perf_counter() - begin) / 5.0
        moving.location.z = 0.6 * share
        moving.rotation_euler.x = 1.2 * share
        yield 0.01
    live.Session.show = original
    FOUND["live_updates_per_second"] = len(shown) / 5.0
    picture("live")
    bar.hide_set(False)
    live.end_all()


def undo_removes_the_result():
    there = "Bar_deformed" in bpy.data.objects
    with override():
        bpy.ops.ed.undo()
    gone = "Bar_deformed" not in bpy.data.objects
    return there and gone and abs(bpy.data.objects["Moving"].location.z - 0.5) < 1e-6


def drive(sequence):
    try:
        return next(sequence)
    except StopIteration:
        FOUND["finished"] = True
    except Exception:
        FOUND["error"] = traceback.format_exc()
    (OUTPUT / "checks.json").write_text(json.dumps(FOUND, indent=1))
    bpy.ops.wm.quit_blender()
    return None


def main():
    bpy.context.preferences.view.show_splash = False
    OUTPUT.mkdir(parents=True, exist_ok=True)
    addon.register()
    sequence = steps()
    bpy.app.timers.register(lambda: drive(sequence), first_interval=1.0, persistent=True)


main()
