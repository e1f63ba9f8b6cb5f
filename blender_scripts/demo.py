# SPDX-License-Identifier: GPL-3.0-or-later
"""Demo without a window: a dog is posed by pins with a carried hat, stylized, and wrapped.

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
import creatures  # noqa: E402
import people  # noqa: E402
import stage  # noqa: E402
from mathutils import Matrix, Vector  # noqa: E402

import addon  # noqa: E402

SPACING, TURN = 1.85, 38.0  # distance of columns along x; degrees of rotation towards the camera
# On the dog at rest: (place, radius) of anchors; of pins also translation and rotation about x.
ANCHORS = [((0.17, 0.45, 0.06), 0.17), ((-0.17, 0.45, 0.06), 0.17), ((-0.17, -0.48, 0.06), 0.17)]
PINS = [
    ((0.17, -0.48, 0.10), 0.17, (0.06, -0.42, 0.42), 0.9),  # gives the paw
    ((0.0, -0.78, 1.20), 0.34, (-0.10, 0.04, 0.10), -0.30),  # looks up
    ((0.05, 0.70, 1.20), 0.20, (0.0, 0.14, 0.10), -0.5),  # and wags
]
COLUMNS = {0: "Mesh", 1: "Posed", 2: "Styled", 4: "Wrapped"}
CAPTIONS = [
    "a mesh,\npins on it",
    "posed in place,\nhat carried",
    "in the style\nof a cube",
    "the scan\nof another",
    "wrapped\nonto it",
]
LANDMARKS = [  # on the dog, on the scan; mirrored in x as well
    ((0, -1.12, 1.15), (0, -1.36, 1.30)),
    ((0.08, 0.50, 1.18), (0, 1.22, 1.24)),
    ((0.20, -0.58, 1.57), (0.24, -0.66, 1.76)),
    ((0.17, -0.62, 0.05), (0.19, -0.72, 0.05)),
    ((0.17, 0.36, 0.05), (0.19, 0.42, 0.05)),
]
SCREEN = os.fdopen(os.dup(1), "w")  # the terminal, while Blender's output is discarded


def job_progress():
    """(progress, message) of the running job, if any."""
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
    """Context manager: discards the standard streams, to which Blender and Cycles write hundreds of lines."""
    kept = [os.dup(number) for number in (1, 2)]
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        for number in (1, 2):
            os.dup2(nowhere.fileno(), number)
        try:
            yield
        finally:
            ctypes.CDLL(None).fflush(None)  # discards C's buffers as well
            for number, stream in zip((1, 2), kept, strict=True):
                os.dup2(stream, number)
                os.close(stream)


def stand(name, shape, column):
    """The shape as an object in its column, on the floor."""
    item = people.coloured(name, shape)
    item.location = ((column - 2) * SPACING, 0, -float(shape.vertices[:, 2].min()))
    item.rotation_euler.z = math.radians(TURN)
    bpy.context.view_layer.update()
    return item


def hat(dog):
    """A party hat between the ears, as an object."""
    bpy.ops.mesh.primitive_cone_add(vertices=48, radius1=0.15, radius2=0.01, depth=0.36)
    item = bpy.context.object
    item.name = "Hat"
    bpy.ops.object.shade_smooth()
    item.data.materials.append(stage.material("Hat", (0.03, 0.20, 0.55)))
    lean = Matrix.Translation((0, -0.60, 1.58)) @ Matrix.Rotation(0.12, 4, "X")
    item.matrix_world = dog.matrix_world @ lean
    return item


def activate(item, *others):
    bpy.ops.object.select_all(action="DESELECT")
    for chosen in (item, *others):
        chosen.select_set(True)
    bpy.context.view_layer.objects.active = item


def add_pins(dog):
    """Adds anchors and pins by the tool's operator; returns the pins' Empties."""
    activate(dog)
    for place, radius in ANCHORS:
        bpy.ops.arapfields.pin_add(location=dog.matrix_world @ Vector(place), radius=radius, anchor=True)
    for place, radius, *_ in PINS:
        bpy.ops.arapfields.pin_add(location=dog.matrix_world @ Vector(place), radius=radius)
    return [handle.empty for handle in dog.arapfields.handles[len(ANCHORS) :]]


def draw_pins(dog):
    """Adds balls and cubes at the pins and anchors, in front of the surface."""
    towards = Vector((0, -0.3, 0.06))
    return [stage.pin(h.empty.matrix_world.translation + towards, h.anchor) for h in dog.arapfields.handles]


def pose(dog, hats):
    """Deforms the dog by a modifier; the hat is carried as a whole."""
    turn = dog.matrix_world.to_3x3()
    for empty, (_, _, shift, angle) in zip(add_pins(dog), PINS, strict=True):
        there = dog.matrix_world @ Matrix.Rotation(angle, 4, "X") @ dog.matrix_world.inverted()
        place = empty.matrix_world.translation + turn @ Vector(shift)
        empty.matrix_world = (
            Matrix.Translation(place) @ (there.to_3x3() @ empty.matrix_world.to_3x3()).to_4x4()
        )
    activate(dog, *hats)
    bpy.ops.arapfields.carry(way="RIGID")
    activate(dog)
    bpy.ops.arapfields.deform()


def wrap(dog, scan):
    """Wraps the dog onto the scan, then moves it to the next column."""
    dog.arapfields.wrap.onto = scan
    activate(dog)
    for on_dog, on_scan in LANDMARKS:
        for side in (1, -1) if on_scan[0] else (1,):
            ends = [Vector((side * x, y, z)) for x, y, z in (on_dog, on_scan)]
            rest, there = (at.matrix_world @ end for at, end in zip((dog, scan), ends, strict=True))
            bpy.ops.arapfields.add_landmark(rest=rest, on_target=there)
    aside = dog.location.x - scan.location.x
    bpy.ops.arapfields.wrap()
    dog.location.x += aside


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("out"))
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    options.output.mkdir(parents=True, exist_ok=True)
    begin = time.perf_counter()
    addon.register()
    stage.clear()
    dogs = {name: stand(name, creatures.load("dog"), column) for column, name in COLUMNS.items()}
    scan = stand("Scan", creatures.hound(), 3)
    hats = [hat(dogs["Mesh"]), hat(dogs["Posed"])]
    with alone():
        add_pins(dogs["Mesh"])
    with alone(), timed("pose by pins, hat carried"):
        pose(dogs["Posed"], hats[1:])
    with alone(), timed("style"):
        activate(dogs["Styled"])
        dogs["Styled"].arapfields.stylize.strength = 0.9
        bpy.ops.arapfields.stylize(style="CUBE")
    with alone(), timed("wrap onto a scan"):
        wrap(dogs["Wrapped"], scan)
    with alone(), timed("picture", lambda: (0.0, "Cycles at work")):
        shown = [*dogs.values(), scan, *hats, *draw_pins(dogs["Mesh"]), *draw_pins(dogs["Posed"])]
        for column, text in enumerate(CAPTIONS):
            shown.append(stage.caption(text, ((column - 2) * SPACING, -1.3, -0.05), 0.2))
        end = (dogs["Wrapped"].location.x + 1.1, 0, 1.75)
        stage.photograph(
            shown, options.output / "demo.png", width=1600, elevation=8, samples=12, around=[end]
        )
    with alone():
        bpy.ops.wm.save_as_mainfile(filepath=str((options.output / "demo.blend").resolve()))
    print(f"{'total':26} {time.perf_counter() - begin:6.1f} s")
    print(
        f"The picture: {options.output / 'demo.png'}. The scene, for Blender: {options.output / 'demo.blend'}"
    )


if __name__ == "__main__":
    main()
