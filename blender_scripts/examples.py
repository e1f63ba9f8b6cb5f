# SPDX-License-Identifier: GPL-3.0-or-later
"""The example scenes of the workflow pages.

    python blender_scripts/examples.py [--output out/examples]

Writes a .blend for each of SCENES, a folder of meshes, and dinosaur.obj.
"""

import argparse
import math
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "blender_scripts")]

import bpy  # noqa: E402
import creatures  # noqa: E402
import people  # noqa: E402
import stage  # noqa: E402
from mathutils import Vector  # noqa: E402

MESHES = ("dinosaur", "dog", "lizard", "octopus", "mug", "chapel")
HANDLES = {  # of animate.blend: center and half extents
    "Feet": ((0, -0.02, 0.14), (0.45, 0.26, 0.17)),
    "Head": ((0, -0.72, 1.40), (0.28, 0.36, 0.30)),
    "Tail": ((0, 1.27, 0.82), (0.16, 0.26, 0.18)),
}
BALL = 0.4  # radius of the obstacle in contact.blend
APART = 1.7  # distance of scan and dog along x
LAST = 48  # last frame of the motion, which is a loop
# A walk in place, as keyframes of three handles: the feet and the hips.
WALK_HANDLES = {  # center and half extents
    "Foot.L": ((0.27, -0.02, 0.09), (0.17, 0.20, 0.10)),
    "Foot.R": ((-0.27, -0.02, 0.09), (0.17, 0.20, 0.10)),
    "Hips": ((0, 0.12, 0.80), (0.22, 0.24, 0.20)),
}
CYCLE, CYCLES = 24, 3  # frames per cycle; secondary motion is periodic after one or two
WALK_LAST = CYCLE * CYCLES
KEYS = 12  # per cycle
STRIDE, LIFT = 0.20, 0.17  # half a step along y, and the height of a raised foot


def figure(name, shape, turn):
    """An object of the shape on the floor, rotated about z by `turn` degrees."""
    item = people.coloured(name, creatures.load(shape))
    item.rotation_euler.z = turn
    item.location.z = -min(vertex.co.z for vertex in item.data.vertices)
    return item


def in_studio(shown, width=960, azimuth=55, elevation=10, around=()):
    """Light, floor and camera, in a collection that is not selectable."""
    before = set(bpy.data.objects)
    stage.set_up(shown, width=width, azimuth=azimuth, elevation=elevation, margin=0.06, around=around)
    stage.brighten(1.4)
    studio = bpy.data.collections.new("Studio")
    bpy.context.scene.collection.children.link(studio)
    for item in set(bpy.data.objects) - before:
        for collection in item.users_collection:
            collection.objects.unlink(item)
        studio.objects.link(item)
    studio.hide_select = True


def chosen(item):
    bpy.ops.object.select_all(action="DESELECT")
    item.select_set(True)
    bpy.context.view_layer.objects.active = item


def pins():
    """A creature without a rig."""
    dinosaur = figure("Dinosaur", "dinosaur", 0)
    in_studio([dinosaur], around=[(0, -1.15, 1.95), (0, 1.45, 1.5)])
    chosen(dinosaur)


def character():
    """A rigged child with eyes, a shirt and hair as separate objects."""
    made = people.build_scene()
    in_studio([made.body], azimuth=18, elevation=6, around=[(-0.95, 0, 1.9), (0.95, 0, 1.9)])
    chosen(made.body)


def skin():
    """A body of separate triangles, eyes, a shirt, and an armature without bindings."""
    body = people.coloured("Body", people.body(cells=72))
    people.shirt(body)
    people.split(body)
    for place, side in zip(people.EYES, "RL", strict=True):
        people.eye(place, side)
    people.rig(people.JOINTS)
    in_studio([body], azimuth=18, elevation=6, around=[(-0.95, 0, 1.9), (0.95, 0, 1.9)])
    chosen(body)


def animate():
    """A creature with animated handles."""
    dinosaur = figure("Dinosaur", "dinosaur", 0)
    empties = held(dinosaur, HANDLES)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, LAST
    half = 1 + LAST // 2
    for name, turn, shift in (
        ("Head", (-0.30, 0.10, 0.45), (0.10, 0.05, 0.22)),
        ("Tail", (0.55, 0.0, -0.35), (-0.35, -0.15, 0.45)),
    ):
        empty = empties[name]
        rest = empty.location.copy()
        for frame, share in ((1, 0.0), (half, 1.0), (LAST + 1, 0.0)):
            empty.location = rest + share * Vector(shift)
            empty.rotation_euler = share * Vector(turn)
            empty.keyframe_insert("location", frame=frame)
            empty.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(1)
    in_studio([dinosaur], around=[(0, -1.15, 1.9), (0, 1.5, 1.5)])
    chosen(dinosaur)


def handle(name, place, half):
    empty = bpy.data.objects.new(name, None)
    empty.empty_display_type, empty.location, empty.scale = "CUBE", place, half
    bpy.context.collection.objects.link(empty)
    return empty


def held(item, places):
    """Adds Empties as handles of an object; places: {name: center and half extents}."""
    empties = {name: handle(name, *place) for name, place in places.items()}
    bpy.context.view_layer.update()
    chosen(item)
    for empty in empties.values():
        empty.select_set(True)
    bpy.ops.arapfields.add_handle()
    return empties


def foot_in_walk(phase):
    """(shift, turn about x in radians) of a foot: half the cycle on the ground, half in the air."""
    if phase < 0.5:
        return Vector((0, STRIDE * (4 * phase - 1), 0)), 0.0
    way = 2 * phase - 1
    return Vector((0, STRIDE * math.cos(math.pi * way), LIFT * math.sin(math.pi * way))), 0.5 * math.sin(
        2 * math.pi * way
    )


def hips_in_walk(phase):
    """(shift, rotation) of the hips: down at each step, yaw and roll once per cycle."""
    once, twice = 2 * math.pi * phase, 4 * math.pi * phase
    shift = Vector((0.05 * math.cos(once), 0, 0.045 * math.cos(twice) - 0.02))
    return shift, (0.05 * math.sin(twice), 0.08 * math.cos(once), 0.22 * math.sin(once))


def set_keys_of_walk(empties):
    """Inserts keyframes of CYCLES cycles from frame 1."""
    rest = {name: empty.location.copy() for name, empty in empties.items()}
    for number in range(KEYS * CYCLES + 1):
        frame, phase = 1 + number * CYCLE / KEYS, number / KEYS
        for name, empty in empties.items():
            if name == "Hips":
                shift, turn = hips_in_walk(phase % 1)
            else:
                shift, about = foot_in_walk((phase + (0.5 if name.endswith("R") else 0.0)) % 1)
                turn = (about, 0, 0)
            empty.location, empty.rotation_euler = rest[name] + shift, turn
            empty.keyframe_insert("location", frame=frame)
            empty.keyframe_insert("rotation_euler", frame=frame)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, WALK_LAST
    scene.frame_set(1)


def walk():
    """A creature that walks in place by animated feet and hips, without handles of neck, head and tail."""
    dinosaur = figure("Dinosaur", "dinosaur", 0)
    set_keys_of_walk(held(dinosaur, WALK_HANDLES))
    in_studio(
        [dinosaur],
        azimuth=52,
        around=[(-0.45, -1.2, 1.6), (0.4, 1.6, 0.9), (-0.4, 1.6, 1.3), (0.76, -0.6, 0)],
    )
    chosen(dinosaur)


def wrap():
    """A dog, and as its target the scan of another one, rough and with holes."""
    dog = figure("Dog", "dog", 0)
    scan = people.coloured("Scan", creatures.hound(), roughness=0.8)
    scan.location.x = APART
    in_studio([dog, scan], azimuth=28, elevation=11, around=[(0, -1.4, 1.3), (0, -0.7, 1.8)])
    chosen(dog)


def transfer():
    """A child with a rig, shape keys, eyes and a shirt, an adult's mesh, and landmarks on both."""
    body, other = people.beside_child(APART)
    in_studio([body, other], azimuth=24, elevation=6, around=[(-0.9, 0, 1.9), (APART + 1.05, 0, 2.3)])
    stage.brighten(0.75)
    chosen(body)


def stylize():
    """A dog, to be stylized."""
    dog = figure("Dog", "dog", 0)
    in_studio([dog], azimuth=40, around=[(0, -1.2, 1.7), (0, 0.9, 1.7)])
    chosen(dog)


def contact():
    """A soft bar above a ball, with handles at both ends."""
    bar = figure("Bar", "slender_bar", 0)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=BALL, location=(0, 0, BALL))
    ball = bpy.context.object
    ball.name = "Ball"
    ball.data.polygons.foreach_set("use_smooth", [True] * len(ball.data.polygons))
    ball.data.materials.append(stage.material("Ball", (0.10, 0.30, 0.55), roughness=0.3))
    bar.location.z = 2 * BALL + 0.02
    held(
        bar,
        {name: ((0.74 * side, 0, 0.94), (0.09, 0.14, 0.14)) for name, side in (("Left", -1), ("Right", 1))},
    )
    in_studio([bar, ball], azimuth=22, elevation=11, around=[(-0.95, 0, 1.05), (0.95, 0, 1.05)])
    chosen(bar)


SCENES = (pins, character, skin, animate, walk, stylize, wrap, transfer, contact)


def comfortable():
    """Sets viewports to show colours, the camera's view, the sidebar, and bones in front of the mesh."""
    for item in list(bpy.data.objects):
        item.show_in_front |= item.type == "ARMATURE"
    for screen in list(bpy.data.screens):
        for area in screen.areas:
            for space in area.spaces:
                if space.type == "VIEW_3D":
                    space.shading.color_type = "VERTEX"
                    space.show_region_ui = True
                    space.region_3d.view_perspective = "CAMERA"


def write(folder):
    """Writes all scenes; returns the files' names."""
    folder.mkdir(parents=True, exist_ok=True)
    for scene in SCENES:
        bpy.ops.wm.read_homefile(use_factory_startup=True)
        stage.clear()
        scene()
        comfortable()
        bpy.context.preferences.filepaths.save_version = 0
        bpy.ops.wm.save_as_mainfile(
            filepath=str((folder / f"{scene.__name__}.blend").resolve()), compress=True
        )
    (folder / "meshes").mkdir(exist_ok=True)
    for name in MESHES:
        export(creatures.load(name), folder / "meshes" / f"{name}.ply")
    export(creatures.load("dinosaur"), folder / "dinosaur.obj")
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def export(shape, path):
    import trimesh

    colours = (255 * shape.colours.clip(0, 1) ** (1 / 2.2)).astype("uint8")
    mesh = trimesh.Trimesh(shape.vertices, shape.triangles, vertex_colors=colours, process=False)
    mesh.export(path, **({"include_color": False, "header": None} if path.suffix == ".obj" else {}))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("out/examples"))
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    import addon

    addon.register()
    from demo import alone

    with alone():
        files = write(options.output)
    print("\n".join(str(options.output / name) for name in files))


if __name__ == "__main__":
    import os

    main()
    sys.stdout.flush()
    os._exit(0)  # bpy 4.5 may deadlock at the end of the process
