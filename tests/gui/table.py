# SPDX-License-Identifier: GPL-3.0-or-later
"""Actions of users on a source, a handle or a result in each stage, in the window, as a table.

Each cell begins in a new file with real jobs and timers, and is judged by the functions of
tests/blender/test_every_stage.py. Writes table.md, and a sheet of pictures for each kind of object;
tracebacks in Blender's output follow their cell. A small window is enough.
"""

import subprocess

import bpy
import stage
from mouse import until, until_idle, until_live_rests
from support.blender import scenes, stages

from addon.core.runtime import jobs
from addon.live import sessions

WHICH = ("source", "handle", "result")
STAGES = ("idle", "job", "live", "bake")
WORK = {"field": "neural", "iterations": 600, "samples": 2000, "batch": 100, "width": 32, "layers": 2}
FRAMES = 8  # frames of a bake
LIMIT = 120.0  # time limit of a stage, in seconds
WIDTH = 320  # width of a cell's picture in pixels


def checks(figures, folder):
    cells = {}
    bpy.context.preferences.system.viewport_aa = "OFF"  # not needed for small pictures
    for which in WHICH:
        for action in ACTIONS:
            for name in STAGES:
                cells[which, action, name] = cell = {}
                print("CELL", which, action, name, flush=True)
                try:
                    yield from one(cell, which, action, name)
                except Exception as error:  # goes on with the next cell
                    cell["wrong"] = f"{type(error).__name__}: {error}"
                print(cell, flush=True)
                picture(folder / f"cell-{which}-{action}-{name}.png")
        write(cells, folder / "table.md")
        sheet(folder, which)
    wrong = {" ".join(key): cell["wrong"] for key, cell in cells.items() if cell.get("wrong")}
    figures["table"] = {"cells": len(cells), "wrong": wrong}
    figures["table_not_at_that_stage"] = [
        " ".join(key) for key, cell in cells.items() if not cell.get("at_it")
    ]


def picture(file):
    """Takes a small picture of the 3D view."""
    window, _, region = stage.view()
    geometry = subprocess.run(
        ["xdotool", "getdisplaygeometry"], check=False, capture_output=True, text=True
    ).stdout
    top = int(geometry.split()[1]) - (window.y + region.y + region.height)
    crop = f"{region.width}x{region.height}+{window.x + region.x}+{top}"
    command = ["import", "-window", "root", "-crop", crop, "+repage", "-resize", f"{WIDTH}x", str(file)]
    subprocess.run(command, check=False)


def chosen(item):
    with stage.override():
        item.hide_set(False)
        scenes.activate(item)


def deleted(item):
    chosen(item)
    with stage.override():
        bpy.ops.object.delete()


def duplicated(item):
    chosen(item)
    with stage.override():
        bpy.ops.object.duplicate()


def hidden(item):
    chosen(item)
    with stage.override():
        bpy.ops.object.hide_view_set()
    item.hide_render = True


def linked(item):
    chosen(item)
    with stage.override():
        bpy.ops.object.duplicate(linked=True)
    bpy.data.scenes.new("Another").collection.objects.link(item)


def within(function):
    def act(item):
        with stage.override():
            function(item)

    return act


ACTIONS = {name: within(function) for name, function in stages.ACTIONS.items()}
ACTIONS |= {function.__name__: function for function in (deleted, duplicated, hidden, linked)}


def one(cell, which, action, name):
    with stage.override():
        bpy.ops.wm.read_homefile(use_empty=True, load_ui=False)
    yield 0.2
    jobs.board.messages.clear()
    yield from begin(which, name)
    cell["at_it"] = at_stage(name)
    with stages.watched() as errors:
        ACTIONS[action](item_of(which))
        yield 0.3
        yield from until_idle(LIMIT)
        yield from until_live_rests(20.0)
        if name == "live":
            drag_on()
            yield 0.2
            yield from until_live_rests(20.0)
        said = stages.all_said()
        cell["seen"] = seen(said)
        judge(cell, action, name, "source" if which == "source" else "handle", said)
    if errors:
        cell["wrong"] = f"{cell.get('wrong', '')} {errors}"


def judge(cell, action, name, which, said):
    try:
        stages.after(action, name, which, said)
        with stage.override():
            stages.again()
    except (AssertionError, AttributeError, RuntimeError) as error:
        cell["wrong"] = f"{type(error).__name__} {error}".strip()
    left = stages.stray()
    if left or jobs.running() is not None:
        cell["wrong"] = f"{cell.get('wrong', '')} left: {left}, a job: {jobs.running() is not None}"


def begin(which, name):
    """Puts the bar with its handles into a stage, with a result if the action is on that."""
    with stage.override():
        bar, _, moving = scenes.bar_with_handles()
        for option, value in WORK.items():
            setattr(bar.arapfields.deform, option, value)
        moving.location.z += stages.LIFT
        if name == "bake":
            moving.keyframe_insert("location", frame=1)
        bpy.context.view_layer.update()
        if which == "result":
            bpy.ops.arapfields.deform("EXEC_DEFAULT", **scenes.NEW)
            scenes.activate(bar)
            bar.hide_render = False
        bpy.ops.view3d.view_all()
        bpy.context.space_data.overlay.show_floor = False
        bpy.ops.ed.undo_push(message="before")
        if name == "live":
            bpy.ops.arapfields.live("INVOKE_DEFAULT")
    yield from until_live_rests(20.0)
    with stage.override():
        if name == "live":
            bpy.ops.ed.undo_push(message="live")
        bpy.data.objects["Bar"]["mark"] = 1
        bpy.ops.ed.undo_push(message="mark")
        if name == "job":
            bpy.ops.arapfields.deform("INVOKE_DEFAULT")
        elif name == "bake":
            bpy.ops.arapfields.bake("INVOKE_DEFAULT", start=1, end=FRAMES, format="KEYS")
    yield from until(is_at_work if name in ("job", "bake") else lambda: True, 5.0)


def is_at_work():
    """Whether the worker has started; it may have ended already."""
    job = jobs.running()
    return job is None or 0 < job.fraction < 1


def item_of(which):
    names = {"source": "Bar", "handle": "Moving", "result": "Bar_deformed"}
    return bpy.data.objects[names[which]]


def at_stage(name):
    return {"idle": True, "live": bool(sessions.live)}.get(name, jobs.running() is not None)


def drag_on():
    """Moves the handle further if it still exists."""
    moving = bpy.context.scene.objects.get("Moving") or bpy.context.scene.objects.get("Other Name")
    if moving is not None and moving.type == "EMPTY" and moving.library is None:
        moving.location.z += 0.1


def seen(said):
    item = stages.source()
    parts = []
    if item is not None:
        parts.append(f"top at {scenes.world_points(item)[:, 2].max():.2f}")
        parts += ["live"] if sessions.is_live(item) else []
        parts += ["modifier"] if "ARAP Fields" in item.modifiers else []
    shown = sorted(one.name for one in bpy.context.view_layer.objects if one.visible_get())
    report = f"; said: {said}" if said else ""
    return f"{', '.join(parts) or 'no source'}; seen: {', '.join(shown)}{report}"


def write(cells, path):
    lines = ["# What was seen at every stage", ""]
    for which in WHICH:
        lines += [f"## The {which}", "", f"| | {' | '.join(STAGES)} |", "|---|" + "---|" * len(STAGES)]
        for action in ACTIONS:
            row = [cells.get((which, action, name), {}) for name in STAGES]
            lines.append(f"| {action} | {' | '.join(text(cell) for cell in row)} |")
        lines.append("")
    path.write_text("\n".join(lines))


def text(cell):
    cell_text = cell.get("seen", "not run")
    cell_text = f"WRONG {cell['wrong']}: {cell_text}" if cell.get("wrong") else cell_text
    return cell_text.replace("|", "/").replace("\n", " ")


def sheet(folder, which):
    """Joins the pictures of all cells of a kind of object by ImageMagick's montage."""
    files = [folder / f"cell-{which}-{action}-{name}.png" for action in ACTIONS for name in STAGES]
    words = [word for file in files if file.exists() for word in ("-label", file.stem[5:], str(file))]
    command = ["montage", *words, "-tile", f"{len(STAGES)}x", "-geometry", "+2+2"]
    subprocess.run([*command, str(folder / f"table-{which}.png")], check=False)
