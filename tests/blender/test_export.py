# SPDX-License-Identifier: GPL-3.0-or-later
"""Export of animations: files, questions before them, carried objects."""

import contextlib
import json
import shutil
import struct
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from pxr import UsdGeom
from support.blender.inside import IN_BLENDER
from support.files.archives import files_of_at_most

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import saved_animation
    from support.blender.panels import Layout
    from support.blender.riders import rider

    from addon.animation import bake_job, exporters, operators
    from addon.animation.properties import ARAPFIELDS_PG_bake
    from addon.blender import property_definitions
    from addon.core.errors import UserError
    from addon.core.runtime import jobs

pytestmark = pytest.mark.in_blender

# Alembic, USD and glTF with what the object does, read back by another Blender, by usd-core and by hand.

EXACT = 1e-6  # of the object's size: single precision
READER = """
import sys, json, bpy, numpy as np
bpy.ops.wm.read_factory_settings(use_empty=True)
kind, path, out, fps, first, last = sys.argv[1:7]
bpy.context.scene.render.fps = int(fps)
if kind == "ABC":
    bpy.ops.wm.alembic_import(filepath=path, set_frame_range=True, as_background_job=False)
elif kind == "USD":
    bpy.ops.wm.usd_import(filepath=path, set_frame_range=True)
else:
    bpy.ops.import_scene.gltf(filepath=path)
item = next(o for o in bpy.data.objects if o.type == "MESH")
scene, found = bpy.context.scene, {}
for frame in range(int(first), int(last) + 1):
    scene.frame_set(frame)
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    world = np.array(evaluated.matrix_world)
    found[str(frame)] = flat.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]
    if kind == "GLTF":
        index = np.empty(len(mesh.vertices), np.float32)
        mesh.attributes["_ORIGINAL_INDEX"].data.foreach_get("value", index)
        found["index"] = index
    evaluated.to_mesh_clear()
np.savez(out, range=[scene.frame_start, scene.frame_end], **found)
import os
os._exit(7)
"""


def scene_to_export():
    """A bar that moves and bends from frame 3 to 7, at 25 frames a second, in a saved file; (bar, folder)."""
    bar, folder = saved_animation()
    bar.location, bar.rotation_euler.z, bar.scale.y = (0.3, 0.2, 0.1), 0.4, 1.2
    index = bar.data.attributes.new("_ORIGINAL_INDEX", "FLOAT", "POINT")
    index.data.foreach_set("value", np.arange(len(bar.data.vertices), dtype=np.float32))
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = 25, 2, 5
    scene.world = bpy.data.worlds.new("World")  # which is no part of the object
    scene.world.use_nodes = True
    return bar, folder


def shown(item, frames):
    """{frame: (n, 3) world points}."""
    contents = {}
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        contents[frame] = scenes.world_points(item)
    return contents


def state(item):
    flags = [(m.name, m.type, m.show_viewport, m.show_render) for m in item.modifiers]
    kinds = bpy.data.objects, bpy.data.meshes, bpy.data.actions, bpy.data.shape_keys, bpy.data.scenes
    scene = bpy.context.scene
    return (
        flags,
        [sorted(kind.keys()) for kind in kinds],
        (scene.frame_start, scene.frame_end, scene.frame_current),
        [o.name for o in bpy.context.selected_objects],
    )


@pytest.mark.parametrize("kind", ["ABC", "USD", "GLTF"])
def test_what_is_exported_is_read_back(kind):
    """By Blender itself, in a process that never heard of the extension."""
    bar, folder = scene_to_export()
    path = folder / f"Bar{dict(ABC='.abc', USD='.usdc', GLTF='.glb')[kind]}"
    bpy.context.scene.frame_set(4)
    before = state(bar)
    assert bpy.ops.arapfields.export_animation(format=kind, filepath=str(path)) == {"FINISHED"}
    assert state(bar) == before and sorted(p.name for p in folder.iterdir()) == [path.name, "scene.blend"]
    bpy.ops.arapfields.bake()
    expected = shown(bar, range(2, 6))
    first = path.stat().st_size
    assert bpy.ops.arapfields.export_animation(format=kind, filepath=str(path)) == {"FINISHED"}
    assert abs(path.stat().st_size - first) < 100  # from the bake as well: nothing else is in it
    out = folder / "found.npz"
    command = [sys.executable, "-c", READER, kind, str(path), str(out), "25", "2", "5"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 7, done.stdout + done.stderr
    read = np.load(out)
    size = np.ptp(expected[2], axis=0).max()
    index = read["index"].astype(int) if kind == "GLTF" else slice(None)
    for frame, points in expected.items():
        assert np.abs(read[str(frame)] - points[index]).max() <= EXACT * size, frame
    if kind == "GLTF":
        assert set(index) == set(range(len(bar.data.vertices)))
    else:
        assert read["range"].tolist() == [2, 5]


def gltf(path):
    """The JSON of a .glb file."""
    content = path.read_bytes()
    (length,) = struct.unpack("<I", content[12:16])
    return json.loads(content[20 : 20 + length])


def test_the_times_of_a_gltf_are_the_frames_seconds():
    _, folder = scene_to_export()
    bpy.ops.arapfields.export_animation(format="GLTF", filepath=str(folder / "a.glb"))
    header = gltf(folder / "a.glb")
    (animation,) = header["animations"]
    times = header["accessors"][animation["samplers"][0]["input"]]
    assert np.allclose([*times["min"], *times["max"]], [2 / 25, 5 / 25]) and times["count"] == 4
    assert len(header["meshes"][0]["primitives"][0]["targets"]) == 4


def test_a_gltf_has_the_materials_of_the_object():
    bar, folder = scene_to_export()
    bar.data.materials.append(bpy.data.materials.new("Mesh"))
    bar.material_slots[0].link = "OBJECT"
    bar.material_slots[0].material = bpy.data.materials.new("Object")
    bpy.ops.arapfields.export_animation(format="GLTF", filepath=str(folder / "a.glb"))
    assert [one["name"] for one in gltf(folder / "a.glb")["materials"]] == ["Object"]


def test_the_times_of_an_alembic_are_seconds():
    """A scene of twice the rate finds each frame at twice its number."""
    bar, folder = scene_to_export()
    bpy.ops.arapfields.bake()
    expected = shown(bar, range(2, 6))
    path, out = folder / "Bar.abc", folder / "found.npz"
    bpy.ops.arapfields.export_animation(format="ABC", filepath=str(path))
    command = [sys.executable, "-c", READER, "ABC", str(path), str(out), "50", "4", "10"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 7, done.stdout + done.stderr
    read = np.load(out)
    assert read["range"].tolist() == [4, 10]
    for frame, points in expected.items():
        assert np.abs(read[str(2 * frame)] - points).max() <= EXACT * np.ptp(points, axis=0).max(), frame


def test_usd_is_what_its_own_library_reads():
    usd = pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
    bar, folder = scene_to_export()
    bpy.ops.arapfields.bake(subframes=2)
    path = folder / "Bar.usdc"
    bpy.ops.arapfields.export_animation(format="USD", filepath=str(path))
    stage = usd.Stage.Open(str(path))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (2, 5)
    assert stage.GetTimeCodesPerSecond() == 25
    (mesh,) = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    for frame, points in shown(bar, range(2, 6)).items():
        local = np.array(mesh.GetPointsAttr().Get(frame), dtype=float)
        matrix = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(mesh.GetPrim()))
        world = local @ matrix[:3, :3] + matrix[3, :3]
        assert np.abs(world - points).max() <= EXACT * np.ptp(points, axis=0).max(), frame


@contextlib.contextmanager
def little_room():
    usage, shutil.disk_usage = shutil.disk_usage, lambda _: types.SimpleNamespace(free=10_000)
    try:
        yield
    finally:
        shutil.disk_usage = usage


@pytest.mark.parametrize("kind", ["ABC", "USD", "GLTF"])
def test_an_export_that_fails_is_named_and_changes_nothing(kind):
    bar, folder = scene_to_export()
    bpy.ops.arapfields.bake()
    path = folder / f"Bar{dict(ABC='.abc', USD='.usdc', GLTF='.glb')[kind]}"
    path.write_bytes(b"before")
    before = state(bar)
    full = {"no room": little_room()}
    if kind != "ABC":  # Alembic's Blender ends there
        full["a limit"] = files_of_at_most(3000)
    for name, disk in full.items():
        with disk, pytest.raises(RuntimeError, match=path.name):
            bpy.ops.arapfields.export_animation(format=kind, filepath=str(path))
        assert path.read_bytes() == b"before"
        for one, other in zip(state(bar), before, strict=True):
            assert one == other, (name, one, other)
    (folder / "cache/scene~Scene~Bar.pc2").unlink()
    with pytest.raises(RuntimeError, match="is not there"):
        bpy.ops.arapfields.export_animation(format=kind, filepath=str(path))
    with pytest.raises(RuntimeError, match="no such folder"):
        bpy.ops.arapfields.export_animation(format=kind, filepath=str(folder / "gone/too" / path.name))
    assert path.read_bytes() == b"before"


# What bakes and exports ask for before they write: an exporter, a folder, leave to overwrite.


def five_frames():
    """The folder of a saved animation."""
    bpy.context.scene.frame_end = 5
    return saved_animation()[1]


def test_a_folder_is_made_where_its_parent_exists():
    folder = five_frames()
    bpy.ops.arapfields.export_animation(format="GLTF", filepath="//new/a.glb")
    assert [path.name for path in (folder / "new").iterdir()] == ["a.glb"]


def test_an_export_that_fails_leaves_no_new_folder():
    folder, write = five_frames(), exporters.write

    def fails(*_):
        raise UserError("The exporter failed")
        yield  # as a coroutine, like the real one

    exporters.write = fails
    try:
        with pytest.raises(RuntimeError, match="The exporter failed"):
            bpy.ops.arapfields.export_animation(format="GLTF", filepath="//new/a.glb")
    finally:
        exporters.write = write
    assert not (folder / "new").exists()


def test_a_format_that_this_blender_lacks_is_greyed_and_says_so():
    """As in builds without Alembic and USD, and where the glTF add-on is off."""
    _, folder = saved_animation()
    lacking = {kind: ("wm", "an_operator_that_is_not_there") for kind in exporters.OPERATORS}
    known = dict(exporters.OPERATORS)
    try:
        exporters.OPERATORS.update(lacking)
        for kind, suffix in exporters.SUFFIXES.items():
            with pytest.raises(RuntimeError, match="This Blender has no exporter for"):
                bpy.ops.arapfields.export_animation(format=kind, filepath=str(folder / f"a{suffix}"))
        rows = menu_rows()
        assert [enabled for _, enabled in rows] == [False] * 3
        assert all("not in this Blender" in text for text, _ in rows)
    finally:
        exporters.OPERATORS.update(known)
    assert menu_rows() == [("Alembic", True), ("USD", True), ("glTF", True)]
    assert [path.name for path in folder.iterdir()] == ["scene.blend"]


def menu_rows():
    """(text, whether it can be pressed) of each row of the menu."""
    rows = []

    class Row(Layout):
        def row(self, **options):
            return Row([])

        def operator(self, name, text, **options):
            rows.append((text, self.__dict__.get("enabled", True)))
            return super().operator(name, text=text, **options)

        def __setattr__(self, name, value):
            self.__dict__[name] = value

    stand_in = types.SimpleNamespace(layout=Row([]))
    exporters.ARAPFIELDS_MT_export.draw(stand_in, bpy.context)
    return rows


def test_a_press_overwrites_only_what_is_the_objects_own_or_confirmed():
    """A script confirms a bake by an argument, an export by its call."""
    folder = five_frames()
    cache, file, asked = folder / "a.pc2", folder / "a.glb", []
    has_window, ask = bake_job.has_window, bake_job.ask
    bake_job.has_window, bake_job.ask = lambda: True, lambda *given: asked.append(given[-1])
    bake, export = operators.ARAPFIELDS_OT_bake, exporters.ARAPFIELDS_OT_export_animation
    try:
        for path, cls, given in ((cache, bake, {}), (file, export, {"format": "GLTF"})):
            assert pressed(cls, filepath=str(path), **given) == {"FINISHED"}
            path.write_bytes(b"another's")
            assert pressed(cls, filepath=str(path), **given) == {"CANCELLED"} and asked.pop() == [path]
            assert pressed(cls, filepath=str(path), overwrite=True, **given) == {"FINISHED"}
        with pytest.raises(RuntimeError, match="is there, and not of this object"):
            bpy.ops.arapfields.bake(filepath=str(cache))
        bpy.ops.arapfields.bake(filepath=str(cache), overwrite=True)
        bpy.ops.arapfields.bake(filepath=str(cache))
        assert pressed(bake, filepath=str(cache)) == {"FINISHED"} and not asked
    finally:
        bake_job.has_window, bake_job.ask = has_window, ask


def test_the_button_that_overwrites_has_the_same_arguments():
    given = bpy.context.window_manager.operator_properties_last("arapfields.bake")
    given.filepath, given.format, given.part = "//a.mdd", "MDD", (1, 2)
    button, shown = types.SimpleNamespace(), {}
    layout = types.SimpleNamespace(operator=lambda name, **_: shown.update(name=name) or button)
    manager = types.SimpleNamespace(popup_menu=lambda draw, title, icon: shown.update(draw=draw, title=title))
    operator = types.SimpleNamespace(properties=given, bl_idname="arapfields.bake")
    bake_job.ask(types.SimpleNamespace(window_manager=manager), operator, [Path("a.mdd")])
    shown["draw"](types.SimpleNamespace(layout=layout), None)
    assert (shown["name"], shown["title"]) == ("arapfields.bake", "a.mdd exists already")
    assert (button.filepath, button.format, tuple(button.part)) == ("//a.mdd", "MDD", (1, 2))
    assert button.overwrite and not hasattr(button, "kind")


def pressed(cls, **given):
    """What a press on the operator's button returns, where all goes well."""

    class Operator(bake_job.BakeOperator):
        scope, overwrite, places, path = "ACTIVE", False, cls.places, getattr(cls, "path", None)
        properties = types.SimpleNamespace(is_property_set=lambda name: name in given)

        def execute(self, context):
            return {"FINISHED"}

    for name, value in given.items():
        setattr(Operator, name, value)
    return Operator().invoke(bpy.context, None)


def test_blender_knows_that_paths_may_be_relative_to_the_file():
    """Else Blender from 4.5 on warns of // and shows the setting in red."""
    known = "is_path_supports_blend_relative"
    if known not in bpy.types.Property.bl_rna.properties:
        assert not property_definitions.RELATIVE
        return
    names = "bake", "export_animation", "apply_pose", "load_pose", "export_pose"
    owners = [getattr(bpy.ops.arapfields, name) for name in names if name in dir(bpy.ops.arapfields)]
    owners = [owner.get_rna_type() for owner in owners] + [ARAPFIELDS_PG_bake.bl_rna]
    own = "Where", "A pose", "The pose"  # the first words of their tooltips
    found = [one for owner in owners for one in owner.properties if one.subtype in ("FILE_PATH", "DIR_PATH")]
    found = [one for one in found if one.description.startswith(own)]
    assert len(found) >= 5 and all(getattr(path, known) for path in found)


# Exports hold what a bake holds: all that the object carries, and a word on what a file cannot hold.

SUFFIXES = {"ABC": ".abc", "USD": ".usdc", "GLTF": ".glb"}
NEAR = 1e-5  # single precision, through exporters and importers
BOX_READER = """
import sys, json, bpy, numpy as np
bpy.ops.wm.read_factory_settings(use_empty=True)
kind, path, out, *frames = sys.argv[1:]
if kind == "ABC":
    bpy.ops.wm.alembic_import(filepath=path, set_frame_range=True, as_background_job=False)
elif kind == "USD":
    bpy.ops.wm.usd_import(filepath=path, set_frame_range=True)
else:
    bpy.ops.import_scene.gltf(filepath=path)
found = {}
for frame in map(int, frames):
    bpy.context.scene.frame_set(frame)
    for item in bpy.data.objects:
        if item.type == "MESH" and item.users_scene:
            evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
            mesh = evaluated.to_mesh()
            flat = np.empty(3 * len(mesh.vertices), np.float32)
            mesh.vertices.foreach_get("co", flat)
            world = np.array(evaluated.matrix_world)
            points = flat.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]
            box = [points.min(axis=0).tolist(), points.max(axis=0).tolist()]
            found.setdefault(item.name, {})[frame] = box
            evaluated.to_mesh_clear()
json.dump(found, open(out, "w"))
import os
os._exit(7)
"""


def knight():
    """A bar that carries meshes, one as a whole, in a saved file; (bar, {name: carried object}, folder)."""
    bar, folder = saved_animation()
    carried = {}
    for number in range(3):
        item = rider("MESH")
        item.name, item.location.y = f"Part {number}", 0.02 * number
        carried[item.name] = item
    scenes.activate(*carried.values(), bar)
    assert bpy.ops.arapfields.carry() == {"FINISHED"}
    stiff = scenes.bar("Stiff", 0.2)
    stiff.location = (0.8, 0.0, 0.5)
    scenes.activate(stiff, bar)
    assert bpy.ops.arapfields.carry(way="RIGID") == {"FINISHED"}
    scenes.activate(bar)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 5
    bpy.context.scene.frame_set(1)
    return bar, {**carried, "Stiff": stiff}, folder


def boxes(items, frames=(1, 5)):
    """[(frame, bounding box)] of each object, sorted: importers and exporters change names."""
    found = []
    for item in items:
        each = {}
        for frame in frames:
            bpy.context.scene.frame_set(frame)
            points = scenes.world_points(item)
            each[frame] = [points.min(axis=0).tolist(), points.max(axis=0).tolist()]
        found.append(each)
    return found


def imported(kind, path):
    out = path.with_suffix(".json")
    command = [sys.executable, "-c", BOX_READER, kind, str(path), str(out), "1", "5"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 7, done.stdout + done.stderr
    read = json.loads(out.read_text())
    out.unlink()
    return read


def alike(read, expected):
    """Whether each expected object is among those read, once, at all frames."""
    left = [{int(frame): box for frame, box in each.items()} for each in read.values()]
    for each in expected:
        near = [one for one in left if all(np.abs(np.array(one[f]) - each[f]).max() < NEAR for f in each)]
        if len(near) != 1:
            return False
        left.remove(near[0])
    return not left


def snapshot():
    kinds = bpy.data.objects, bpy.data.meshes, bpy.data.actions, bpy.data.shape_keys, bpy.data.node_groups
    stacks = {
        o.name: [(m.name, m.show_viewport, getattr(m, "filepath", "")) for m in o.modifiers] for o in kinds[0]
    }
    return [sorted(kind.keys()) for kind in kinds], stacks


@pytest.mark.parametrize("kind", SUFFIXES)
def test_a_file_holds_all_that_is_carried_whether_baked_or_not(kind):
    bar, carried, folder = knight()
    before, paths = snapshot(), [folder / f"{name}{SUFFIXES[kind]}" for name in ("solved", "baked")]
    assert bpy.ops.arapfields.export_animation(format=kind, filepath=str(paths[0])) == {"FINISHED"}
    assert any("frames of 5 objects exported" in text for _, text in jobs.messages()), jobs.messages()
    assert not [text for level, text in jobs.messages() if level != "INFO"]
    assert snapshot() == before
    assert bpy.ops.arapfields.bake(start=1, end=5) == {"FINISHED"}
    expected = boxes([bar, *carried.values()])
    assert all(np.abs(np.array(one[5]) - one[1]).max() > 0.05 for one in expected)
    bpy.context.scene.frame_set(1)
    scenes.activate(bar)
    assert bpy.ops.arapfields.export_animation(format=kind, filepath=str(paths[1])) == {"FINISHED"}
    for path in paths:
        assert alike(imported(kind, path), expected), (path.name, imported(kind, path), expected)


@pytest.mark.parametrize("kind", SUFFIXES)
def test_what_a_file_does_not_hold_is_named(kind):
    bar, carried, folder = knight()
    hair, hidden = rider("CURVES"), carried["Part 1"]
    scenes.activate(hair, bar)
    bpy.ops.arapfields.carry()
    hidden.hide_set(True)
    scenes.activate(bar)
    for name, word in (("solved", "bake, then export"), ("baked", "holds none of its kind")):
        path = folder / f"{name}{SUFFIXES[kind]}"
        assert bpy.ops.arapfields.export_animation(format=kind, filepath=str(path)) == {"FINISHED"}
        told = " ".join(text for level, text in jobs.messages() if level == "WARNING")
        assert "Part 1 is hidden" in told or "Part 1" in told.split(" is not in")[0], told
        if name == "solved" or kind == "GLTF":
            assert "Hair" in told and word in told, told
        assert bpy.ops.arapfields.bake(start=1, end=5) == {"FINISHED"}
        scenes.activate(bar)
