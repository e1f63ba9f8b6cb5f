# SPDX-License-Identifier: GPL-3.0-or-later
"""A .blend as a job: baked by one process, or by several that share its frames, with kills in between."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import baking

ROOT = Path(__file__).resolve().parents[2]


def save_scene(folder):
    """In the worker: scene.blend with a bar that bends from frame 1 to 5."""
    baking.saved_animation("Bar", Path(folder))
    bpy.context.scene.frame_end = 5
    bpy.ops.wm.save_mainfile()


@pytest.fixture
def scene(blender, tmp_path):
    """A folder with that file."""
    folder = tmp_path / "scene"
    folder.mkdir()
    blender.call(__file__, "save_scene", {"folder": folder})
    return folder


def save_two_scenes(folder):
    """In the worker: a second scene and an excluded collection with bars of their own."""
    baking.saved_animation("Bar", Path(folder))
    home, shown = bpy.data.collections.new("Away"), bpy.context.scene
    shown.collection.children.link(home)
    bpy.context.view_layer.active_layer_collection = bpy.context.view_layer.layer_collection.children["Away"]
    baking.animated("Excluded")
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    baking.animated("Elsewhere")
    bpy.context.window.scene = shown
    bpy.context.view_layer.layer_collection.children["Away"].exclude = True
    shown.frame_end = 3
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder) / "two.blend"))


def test_objects_that_are_left_out_are_named(blender, command, tmp_path):
    blender.call(__file__, "save_two_scenes", {"folder": tmp_path})
    done = command("bake", "-i", tmp_path / "two.blend")
    assert "left out, in another scene or a collection that is excluded: Elsewhere, Excluded" in done.stderr
    assert [path.name for path in (tmp_path / "cache").iterdir()] == ["two~Scene~Bar.pc2"]
    assert "left out" not in command("bake", "-i", tmp_path / "two.blend", "--objects", "Bar").stderr


def save_scenes_with_it_disabled(folder):
    """In the worker: the same with shape keys, elsewhere; shown, or disabled by itself or its collection."""
    bar, _ = baking.saved_animation("Bar", Path(folder))
    bar.location.y += 3.0
    root = bpy.data.objects.new("Root", None)  # what takes the handles along
    bpy.context.scene.collection.objects.link(root)
    root.location.y = 3.0
    for handle in bar.arapfields.handles:
        handle.empty.parent = root
    bar.shape_key_add(name="Basis")
    key = bar.shape_key_add(name="Wide")
    for point in key.data:
        point.co.y *= 1.5
    key.value = 1.0
    home = bpy.data.collections.new("Home")
    bpy.context.scene.collection.children.link(home)
    home.objects.link(bar)
    bpy.context.scene.collection.objects.unlink(bar)
    bpy.context.scene.frame_end = 5
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder) / "shown.blend"))
    for name, item in (("itself", bar), ("collection", home)):
        item.hide_viewport = True
        bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder) / f"{name}.blend"))
        item.hide_viewport = False


def is_disabled_as_it_was(folder, name):
    """In the worker: the output has the object where it was."""
    bpy.ops.wm.open_mainfile(filepath=str(Path(folder) / f"{name}_baked.blend"))
    bar = bpy.data.objects["Bar"]
    assert [home.name for home in bar.users_collection] == ["Home"] and bar.modifiers
    assert bar.hide_viewport == (name == "itself")
    assert bpy.data.collections["Home"].hide_viewport == (name == "collection")


def test_an_object_that_is_disabled_in_viewports_is_baked_as_one_that_is_shown(blender, command, tmp_path):
    blender.call(__file__, "save_scenes_with_it_disabled", {"folder": tmp_path})
    caches = {}
    for name in ("shown", "itself", "collection"):
        for objects in ((), ("--objects", "Bar")):
            command("bake", "-i", tmp_path / f"{name}.blend", "--folder", tmp_path / name, *objects)
            caches[name, objects] = (tmp_path / name / f"{name}~Scene~Bar.pc2").read_bytes()
        command("bake", "-i", tmp_path / f"{name}.blend", "-o", tmp_path / f"{name}_baked.blend")
        blender.call(__file__, "is_disabled_as_it_was", {"folder": tmp_path, "name": name})
    assert len(set(caches.values())) == 1, {key: hash(value) for key, value in caches.items()}


@pytest.mark.slow
def test_parts_in_any_order_make_the_cache_that_one_process_makes(scene, user_folder):
    folder = scene

    def run(*arguments):
        call = [sys.executable, str(ROOT / "blender_scripts/bake.py"), "-i", str(folder / "scene.blend")]
        done = subprocess.run([*call, *map(str, arguments)], env=user_folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
        return done

    run("-o", folder / "baked.blend")
    whole, name = (folder / "cache/scene~Scene~Bar.pc2").read_bytes(), "scene~Scene~Bar.pc2"
    assert len(whole) == 32 + 5 * 12 * 386 and (folder / "baked.blend").exists()
    shared = folder / "shared"
    shared.mkdir()
    parts = ["--folder", shared, "--shard"]
    said = run(*parts, "2/3").stdout
    assert "3 of 5 frames to come" in said  # of 2 and 5
    assert not (shared / name).exists()
    frames = sorted((shared / f".{name}.frames").iterdir())
    kept = [path for path in frames if path.name != "lock"]
    kept[0].unlink()  # as if it had been killed before it came to that frame
    stamps = {path: path.stat().st_mtime_ns for path in kept[1:]}
    run(*parts, "3/3"), run(*parts, "2/3")
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in stamps.items())  # solved once
    run(*parts, "1/3")
    assert (shared / name).read_bytes() == whole
    assert [path.name for path in shared.iterdir()] == [name]


def test_an_export_and_what_cannot_be_baked(scene, command):
    folder = scene
    bake = ["bake", "-i", folder / "scene.blend"]
    command(*bake, "-o", folder / "bar.usdc", "--frames", "2-4")
    assert (folder / "bar.usdc").read_bytes()[:8] == b"PXR-USDC"
    for arguments, text in (
        (["-o", folder / "bar.obj"], "unknown extension"),
        (["--frames", "5-1"], "is not A-B"),
        (["--objects", "None"], "no mesh object named None"),
        (["--folder", folder / "gone/too"], "no such folder"),
        (["--folder", folder / "bar.usdc"], f"arapfields: {folder / 'bar.usdc'}: "),
        (["-o", folder / "bar.abc", "--shard", "1/2"], "an exported file has no parts"),
    ):
        done = command(*bake, *arguments, check=False)
        assert done.returncode in (1, 2) and text in done.stderr, (arguments, done.stderr)
    assert np.all([not path.name.startswith(".") for path in folder.iterdir()])
