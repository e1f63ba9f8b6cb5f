# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving pictures, a still frame beside each."""

import json
import math
import tempfile
import time
from pathlib import Path

import at_hand
import bpy
import examples
import numpy as np
import stage
from mathutils import Matrix
from mathutils.bvhtree import BVHTree
from people import seen_mesh

import arapfields as af

from . import common
from .common import add, samples_of, shape, stack, turned, warped
from .deforming import CASES
from .styling import OPTIONS
from .workflows import followed, in_examples, moved, snapshot

# Short loops as an animated WebP, there and back or round and round, and a frame as a picture of its own.

FRAMES, MILLISECONDS, REST = 10, 108, 400  # rendered, of one frame, of the ends
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
    order = [*taken, *taken[-2:0:-1]]
    waits = [MILLISECONDS] * len(order)
    waits[0] = waits[frames - 1] = REST
    return {"frames": frames, "bytes": encode(order, waits, output / f"{name}.webp", taken[-1])}


def encode(order, waits, path, poster):
    """The frames, each for so many milliseconds, as good as fits in MOST, and one as a JPEG; bytes."""
    for quality in QUALITY:
        order[0].save(
            path, save_all=True, append_images=order[1:], duration=waits, loop=0, quality=quality, method=6
        )
        if path.stat().st_size <= MOST:
            break
    poster.save(path.with_suffix(".jpg"), quality=86, optimize=True)
    return path.stat().st_size


# The pin page's steps done by mouse in Blender's window, as film.py records them. The pictures of
# the screen lack the cursor: an arrow is drawn where it was.

VIEW = (0, 27, 722, 555)  # of the window: the viewport with its toolbar
WINDOW_WIDTH = 600
WAIT = 90  # milliseconds, times what a frame is to be held
ARROW = ((0, 0), (0, 22), (5, 17), (9, 26), (13, 24), (9, 16), (16, 16))


def with_cursor(picture, spot, pressed):
    from PIL import ImageDraw

    drawing = ImageDraw.Draw(picture)
    if pressed:
        drawing.ellipse([spot[0] - 9, spot[1] - 9, spot[0] + 9, spot[1] + 9], outline="white", width=2)
    arrow = [(spot[0] + x, spot[1] + y) for x, y in ARROW]
    drawing.polygon(arrow, fill="white", outline="black")
    return picture


def window_loop(output):
    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        film = Path(folder) / "film"
        at_hand.record("out/examples/pins.blend", film)
        found = json.loads((film / "checks.json").read_text())
        if "error" in found:
            raise RuntimeError(found["error"])
        frames, taken = json.loads((film / "film.json").read_text()), []
        for number, frame in enumerate(frames):
            picture = Image.open(film / f"{number:03}.png").convert("RGB")
            picture = with_cursor(picture, frame["cursor"], frame["pressed"]).crop(VIEW)
            height = round(WINDOW_WIDTH * picture.height / picture.width)
            taken.append(picture.resize((WINDOW_WIDTH, height), Image.Resampling.LANCZOS))
    waits = [WAIT * frame["hold"] for frame in frames]
    size = encode(taken, waits, output / "loop-window.webp", taken[-1])
    return {"frames": len(taken), "bytes": size, "pins": len(found["pins"]), "moved": found["moved"]}


def draw_loop_window(output):
    return in_examples(lambda: window_loop(output.resolve()))


# The dinosaur of the pin page, its pins drawn, on the way to its pose.


def parts(share):
    """Of the way of the head and of the tail: the head goes first."""
    return [min(1, max(0, 1.8 * share - start)) for start in (0.0, 0.8)]


def pins_loop(output):
    dinosaur = followed("pins")["dinosaur"]
    handles = list(dinosaur.arapfields.handles)
    ends = [handle.empty.matrix_world.copy() for handle in handles]
    rests = [Matrix([handle.rest[k : k + 4] for k in range(0, 16, 4)]) for handle in handles]
    markers = [stage.pin((0, 0, 0), handle.anchor) for handle in handles]
    out = stage_side()

    def pose(share):
        shares = [0.0] * (len(handles) - 2) + parts(share)
        for handle, rest, end, part, drawn in zip(handles, rests, ends, shares, markers, strict=True):
            place = rest.lerp(end, part)
            handle.empty.matrix_world = place
            drawn.matrix_world = Matrix.Translation(out * 0.20) @ Matrix.Translation(place.translation)
        bpy.ops.object.select_all(action="DESELECT")
        dinosaur.select_set(True)
        bpy.context.view_layer.objects.active = dinosaur
        bpy.ops.arapfields.deform()

    return film(output, "loop-pins", pose)


def stage_side():
    """Towards the camera."""
    camera = bpy.context.scene.camera
    return camera.matrix_world.to_3x3().col[2].normalized()


def draw_loop_pins(output):
    return in_examples(lambda: pins_loop(output.resolve()))


# The child of the character page on the way to its pose: eyes, shirt and hair are objects of their own.


def character_loop(output):
    names = followed("character")
    bones = names["rig"].pose.bones
    ends = {bone.name: bone.rotation_euler.copy() for bone in bones}

    def pose(share):
        for bone in bones:
            bone.rotation_euler = [share * angle for angle in ends[bone.name]]
        names["select"]()
        bpy.ops.arapfields.deform()

    return film(output, "loop-character", pose, width=400)


def draw_loop_character(output):
    return in_examples(lambda: character_loop(output.resolve()))


# The pose of the skin page by Blender's automatic weights, triangles apart and welded, and by the page.

SCENE, WIDTH = "out/examples/skin.blend", 320


def pose(turns, share=1.0):
    for name, turn in turns.items():
        bpy.data.objects["Rig"].pose.bones[name].rotation_euler = [share * angle for angle in turn]


def automatic(weld):
    """The scene with Blender's weights."""
    bpy.ops.wm.open_mainfile(filepath=SCENE)
    body, rig = bpy.data.objects["Body"], bpy.data.objects["Rig"]
    if weld:
        body.modifiers.new("Weld", "WELD").merge_threshold = 1e-5
        bpy.ops.object.modifier_apply(modifier="Weld")
    bpy.ops.object.select_all(action="DESELECT")
    for item in (*(item for item in bpy.data.objects if item.type == "MESH"), rig):
        item.select_set(item.users_collection[0].name != "Studio")
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")


def points():
    body = bpy.data.objects["Body"]
    seen = body.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return [np.array([vertex.co for vertex in mesh.vertices]) for mesh in (body.data, seen)]


def gap():
    """How far corners that are one at rest are apart in the pose, most, as a share of the height."""
    rest, now = points()
    _, same = np.unique(rest.round(5), axis=0, return_inverse=True)
    same = same.ravel()
    low, high = np.full((same.max() + 1, 3), np.inf), np.full((same.max() + 1, 3), -np.inf)
    np.minimum.at(low, same, now)
    np.maximum.at(high, same, now)
    return round(float(np.linalg.norm(high - low, axis=1).max() / np.ptp(rest[:, 2])), 6)


def draw(output):
    bpy.ops.wm.open_mainfile(filepath=SCENE)
    paths, gaps = [snapshot(output / "rest.png", WIDTH)], {}
    turns = {name: tuple(turn) for name, turn in followed("skin")["radians"].items()}
    gaps["ours"] = gap()
    ours = snapshot(output / "ours.png", WIDTH)
    measured = film(output, "loop-skin", lambda share: pose(turns, share), width=400)
    for name, weld in (("apart", False), ("welded", True)):
        automatic(weld)
        pose(turns)
        bpy.context.view_layer.update()
        gaps[name] = gap()
        paths.append(snapshot(output / f"{name}.png", WIDTH))
    stack([*paths, ours], output / "workflow-skin.png", gap=0, horizontal=True)
    return {**measured, "gaps": gaps}


def draw_loop_skin(output):
    return in_examples(lambda: draw(output.resolve()))


# The walk of its page, without and with secondary motion, side by side; and four of its frames.

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
    frames = range(
        examples.WALK_LAST - examples.CYCLE + 1, examples.WALK_LAST + 1, STEP * (4 if stage.DRAFT else 1)
    )
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


def walk_loop(output):
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


def draw_loop_walk(output):
    return in_examples(lambda: walk_loop(output.resolve()))


# The dog of the wrap page between its own shape and that of the scan, which stands beside it; both ends.


def wrap_loop(output):
    bpy.ops.wm.open_mainfile(filepath="out/examples/wrap.blend")
    rest = snapshot(output / "wrap-rest.png", 480)
    dog = followed("wrap")["dog"]
    end = snapshot(output / "wrap-end.png", 480)
    stack([rest, end], output / "workflow-wrap.png", gap=0, horizontal=True)
    far = moved("Dog")
    apart = -dog.location.x
    from addon.field_modifier import node_group

    def pose(share):
        node_group.put(dog.modifiers["ARAP Fields"], "Factor", share)
        dog.location.x = -apart * share
        dog.update_tag()

    return {**film(output, "loop-wrap", pose, width=440), "moved": far}


def draw_loop_wrap(output):
    return in_examples(lambda: wrap_loop(output.resolve()))


# The child and the grown-up of the transfer page, before and after, and both moved alike.


def cut(shirt, skin):
    """The share of a shirt's vertices that lie below the skin, as both are shown."""
    places, (points, _, triangles) = seen_mesh(shirt)[0], seen_mesh(skin)
    tree = BVHTree.FromPolygons(points.tolist(), triangles.tolist())
    below = []
    for place in places:
        nearest, normal, _, _ = tree.find_nearest(place)
        below.append(np.dot(np.subtract(place, nearest), normal) < 0)
    return round(float(np.mean(below)), 4)


def transfer_loop(output):
    bpy.ops.wm.open_mainfile(filepath="out/examples/transfer.blend")
    before = snapshot(output / "transfer-before.png", 480)
    names = followed("transfer")
    after = snapshot(output / "transfer-after.png", 480)
    stack([before, after], output / "workflow-transfer.png", gap=0, horizontal=True)
    pose, below = names["pose"], {}
    for when, share in (("posed", 1.0), ("rest", 0.0)):
        pose(share)
        for of in ("", " Grown-up"):
            shirt, skin = (bpy.data.objects[name] for name in (f"Shirt{of}", of[1:] or "Child"))
            below[f"{skin.name}, {when}"] = cut(shirt, skin)
    return {**film(output, "loop-transfer", pose), "below_skin": below}


def draw_loop_transfer(output):
    return in_examples(lambda: transfer_loop(output.resolve()))


# The bar of the contact page pulled over the ball, beside the same without contact.


def depth():
    """How deep the bar's deepest vertex lies in the ball, as a share of the ball's radius."""
    bar, ball = bpy.data.objects["Bar"], bpy.data.objects["Ball"]
    away = np.linalg.norm(seen_mesh(bar)[0] - ball.location, axis=1)
    return round(max(0.0, 1 - float(away.min()) / (ball.dimensions.z / 2)), 4)


def contact_loop(output):
    names = followed("contact")
    bar, ends = names["bar"], names["ends"]
    touching, depths = bar.arapfields.contact, {"with": depth()}
    shown = snapshot(output / "contact-with.png", 480)
    touching.use = False
    bpy.ops.arapfields.deform()
    depths["without"] = depth()
    stack(
        [snapshot(output / "contact-without.png", 480), shown],
        output / "workflow-contact.png",
        gap=0,
        horizontal=True,
    )
    touching.use = True
    there = {end: end.location.copy() for end in ends}
    bpy.ops.arapfields.live(kind="DEFORM")

    def pose(share):
        for end, place in there.items():
            end.location = names["rest"][end.name].lerp(place, share)
        bpy.context.view_layer.update()

    return {**film(output, "loop-contact", pose), "depth": depths}


def draw_loop_contact(output):
    return in_examples(lambda: contact_loop(output.resolve()))


# A dog between its shape and the style of a cube, above the slider that does it.

LENGTH = 1.3


def rod(name, centre, half, colour):
    import bpy

    bpy.ops.mesh.primitive_cube_add(size=2)
    item = bpy.context.object
    item.name, item.matrix_world = name, Matrix.Translation(centre) @ Matrix.Diagonal((*half, 1))
    item.data.materials.append(stage.material(name, colour, roughness=0.6))
    return item


def slider():
    """What shows the strength: a rail, a knob, a caption."""
    rail = rod("rail", (0, -1.2, 0.05), (LENGTH / 2, 0.015, 0.015), (0.25, 0.25, 0.27))
    knob = rod("knob", (0, -1.2, 0.06), (0.05, 0.06, 0.06), stage.RESULT)
    return [rail, knob, stage.caption("strength", (0, -1.5, 0.01), 0.12)]


def draw_loop_style(output):
    dog = shape("dog")
    live = af.LiveDeformer(samples_of(dog), options=af.LiveOptions(**OPTIONS))
    stage.clear()
    item = add(dog, "dog", turned(dog, 0, 48))
    parts = slider()
    stage.set_up(
        [item, *parts], width=440, elevation=9, margin=0.06, around=[(-0.9, 0, 1.75), (0.9, 0, 1.75)]
    )
    stage.brighten(1.3)
    preferences = []

    def pose(share):
        live.set_style("cube", max(0.9 * share, 1e-3))
        moved = warped(dog, live.solve()).vertices
        moved[:, 2] -= moved[:, 2].min() - dog.vertices[:, 2].min()
        item.data.vertices.foreach_set("co", np.ascontiguousarray(moved, np.float32).ravel())
        item.data.update()
        parts[1].location.x = LENGTH * (share - 0.5)
        preferences.append(round(live.report.preference, 3))

    return {**film(output, "loop-style", pose), "preferences": [preferences[0], preferences[-1]]}


# A scan of Gaussian splats, without a surface, posed by a field; and what its parts give.

SIZE, SPLAT_FRAMES, SPLATS = (440, 330), 12, 14000
EYE, TARGET = np.array([1.6, -5.6, 2.6]), np.array([0.0, -0.1, 0.5])


def draw_loop_splats(output):
    import arapfields as af

    octopus = shape("octopus")
    scan = common.splats_of_surface(octopus, SPLATS)
    samples = af.sample_splats(scan, 6000)
    boxes = CASES["octopus"][1]
    live = af.LiveDeformer(samples, [box.handle for box in boxes])
    prepared, ground = af.PreparedSplats(scan), float(scan.centers[:, 2].min())

    def posed(share):
        shifts = [tuple(share * np.array(box.shift)) for box in boxes]
        parts = [box._replace(angle=share * box.angle, shift=s) for box, s in zip(boxes, shifts, strict=True)]
        return live.solve([np.array(part.target) for part in parts])

    def picture(splats):
        from PIL import Image

        return Image.fromarray(common.splat_picture(splats, EYE, TARGET, SIZE, focal=4.6, ground=ground))

    frames, seconds = 4 if stage.DRAFT else SPLAT_FRAMES, 0.0
    taken = []
    for frame in range(frames):
        field = posed((1 - math.cos(math.pi * frame / (frames - 1))) / 2)
        begin = time.process_time()
        moved = prepared.moved(field)
        seconds += time.process_time() - begin if frame else 0.0
        taken.append(picture(moved))
    unturned = af.GaussianSplats(
        field(np.asarray(scan.centers, float)), scan.rotations, scan.scales, scan.opacities, scan.harmonics
    )
    sheet(output / "workflow-splats.png", [taken[0], picture(unturned), taken[-1]])
    order = [*taken, *taken[-2:0:-1]]
    waits = [MILLISECONDS] * len(order)
    waits[0] = waits[frames - 1] = REST
    size = encode(order, waits, output / "loop-splats.webp", taken[-1])
    return {"splats": len(scan), "divided": len(moved) - len(scan), "frames": frames, "bytes": size}


def sheet(path, pictures):
    """Side by side."""
    from PIL import Image

    whole = Image.new("RGB", (len(pictures) * SIZE[0], SIZE[1]), "white")
    for place, one in enumerate(pictures):
        whole.paste(one, (place * SIZE[0], 0))
    whole.save(path)
