# SPDX-License-Identifier: GPL-3.0-or-later
"""The main job from end to end, headless: Suzanne is fitted, deformed under three handles and rendered.

    python blender_scripts/demo.py [--output out]

Writes demo.blend and demo.png, and prints each stage's time and figures.
"""

import argparse
import contextlib
import ctypes
import math
import os
import sys
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "blender_scripts")]

import bpy  # noqa: E402
import stage  # noqa: E402
from mathutils import Matrix, Vector  # noqa: E402

import addon  # noqa: E402

# Name, centre, half-extents, turn about y at `pivot` (degrees): the muzzle stays, the ears turn up.
HANDLES = [
    ("muzzle", (0.0, -0.30, -0.50), (0.58, 0.75, 0.52), 0.0, (0.0, 0.0, 0.0)),
    ("left ear", (1.14, 0.30, 0.14), (0.27, 0.32, 0.44), -60.0, (0.80, 0.0, 0.20)),
    ("right ear", (-1.14, 0.30, 0.14), (0.27, 0.32, 0.44), 60.0, (-0.80, 0.0, 0.20)),
]
SPACING = 3.3
SCREEN = os.fdopen(os.dup(1), "w")  # stays when Blender's own lines are sent away


def job_progress():
    """Share done and message of the operator's job, if one runs."""
    from addon.core.runtime import jobs

    return jobs.progress()


@contextlib.contextmanager
def timed(title, progress=job_progress):
    """Prints a stage's title, a progress bar while it runs, and its time."""
    done = threading.Event()
    begin = time.perf_counter()

    def draw():
        while not done.wait(0.5 if SCREEN.isatty() else 5):
            share, text = progress()
            bar = "#" * round(24 * share)
            print(
                f"\r{title:26} [{bar:24}] {100 * share:3.0f} %  {text.split(',')[0][:44]:44}",
                end="",
                flush=True,
                file=SCREEN,
            )

    thread = threading.Thread(target=draw, daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()
        print(f"\r{title:26} {time.perf_counter() - begin:6.1f} s{'':60}", flush=True, file=SCREEN)


@contextlib.contextmanager
def alone():
    """Blender and Cycles write hundreds of lines to the standard streams: they go nowhere."""
    kept = [os.dup(number) for number in (1, 2)]
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        for number in (1, 2):
            os.dup2(nowhere.fileno(), number)
        try:
            yield
        finally:
            ctypes.CDLL(None).fflush(None)  # what C still holds goes nowhere, too
            for number, stream in zip((1, 2), kept, strict=True):
                os.dup2(stream, number)
                os.close(stream)


def suzanne():
    """Suzanne with a UV map, two materials and a subdivision modifier: the artist's mesh."""
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.context.object
    monkey.name = "Suzanne"
    monkey.modifiers.new("Subdivision", "SUBSURF").levels = 2
    monkey.modifiers["Subdivision"].render_levels = 2
    mesh = monkey.data
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    mesh.materials.append(stage.material("skin", stage.CLAY))
    return monkey


def add_handles(monkey):
    """Empties as handles; the turned ones are moved after their rest pose has been stored."""
    empties = []
    for name, centre, half, _, _ in HANDLES:
        bpy.ops.object.empty_add(type="CUBE", radius=1.0, location=centre)
        empty = bpy.context.object
        empty.name, empty.scale = name, half
        empties.append(empty)
    bpy.context.view_layer.update()
    for empty in empties:
        empty.select_set(True)
    bpy.context.view_layer.objects.active = monkey
    bpy.ops.arapfields.add_handle()
    rest = [empty.matrix_world.copy() for empty in empties]
    for empty, (_, _, _, angle, pivot) in zip(empties, HANDLES, strict=True):
        there = Matrix.Translation(Vector(pivot))
        empty.matrix_world = (
            there @ Matrix.Rotation(math.radians(angle), 4, "Y") @ there.inverted() @ empty.matrix_world
        )
    bpy.context.view_layer.update()
    return rest, [empty.matrix_world.copy() for empty in empties]


def activate(item):
    bpy.ops.object.select_all(action="DESELECT")
    item.select_set(True)
    bpy.context.view_layer.objects.active = item


def arrange(monkey, results, rest, targets, path):
    """Rest shape and results side by side, each with its boxes, and a picture of them."""
    shown = []
    columns = [("rest shape, handles", monkey, rest, None)]
    columns += [(text, item, targets, colour) for text, item, colour in results]
    for column, (text, item, boxes, colour) in enumerate(columns):
        shift = Matrix.Translation(((column - 1) * SPACING, 0, 0))
        item.matrix_world = shift @ item.matrix_world
        if colour:
            stage.paint(item, colour)
        shown.append(item)
        for number, matrix in enumerate(boxes):
            colour_of_box = stage.BOX_COLOURS[number % len(stage.BOX_COLOURS)]
            shown.append(stage.box(f"{text} {HANDLES[number][0]}", shift @ matrix, colour_of_box))
        shown.append(stage.caption(text, ((column - 1) * SPACING, -1.0, -1.5)))
    stage.photograph(shown, path, width=1440)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("out"))
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    options.output.mkdir(parents=True, exist_ok=True)
    begin = time.perf_counter()
    addon.register()
    stage.clear()
    monkey = suzanne()
    activate(monkey)
    fit = monkey.arapfields.fit
    fit.iterations, fit.octaves = 800, 5  # the eyes need more than the default
    with alone(), timed("neural surface (fit)"):
        bpy.ops.arapfields.fit(again=True)
    with alone():
        rest, targets = add_handles(monkey)
    results = []
    for output, text, colour in (
        ("WARP", "original mesh warped", stage.RESULT),
        ("SURFACE", "implicit surface", stage.SURFACE),
    ):
        activate(monkey)
        with alone(), timed(f"deform, {text}"):
            bpy.ops.arapfields.deform(output=output, target="NEW")
        results.append((text, bpy.context.view_layer.objects.active, colour))
    monkey.hide_render = False  # the picture shows it beside its results
    monkey.hide_set(False)
    with alone(), timed("picture", lambda: (0.0, "Cycles at work")):
        arrange(monkey, results, rest, targets, options.output / "demo.png")
    with alone():
        bpy.ops.wm.save_as_mainfile(filepath=str((options.output / "demo.blend").resolve()))
    print(f"{'total':26} {time.perf_counter() - begin:6.1f} s")
    print(
        f"The picture: {options.output / 'demo.png'}. The scene, for Blender: {options.output / 'demo.blend'}"
    )


if __name__ == "__main__":
    main()
