# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of caches: each says file, scene and object, and no object's bake takes another's place."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import animated, at, saved_animation
    from support.blender.riders import rider

    from addon.animation import caches
    from addon.blender import modifier_stack

pytestmark = pytest.mark.in_blender


def saved(path):
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def tip(item, frame):
    points = at(item, frame)
    return points[points[:, 0] > 0.9][:, 2].mean()


def baked(**given):
    assert bpy.ops.arapfields.bake(start=1, end=3, **given) == {"FINISHED"}
    return modifier_stack.find_cache(bpy.context.view_layer.objects.active).filepath


@pytest.mark.parametrize("where", ["beside", "//../caches", "anywhere"])
def test_two_shots_with_one_name_of_an_object_play_each_its_own(where):
    home = Path(tempfile.mkdtemp())
    folder, moved = {"beside": "//cache", "anywhere": str(home / "caches")}.get(where, where), {}
    for shot, factor in (("a/shot010", 0.5), ("a/shot020", 1.0), ("b/shot010", 2.0)):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bar = animated("Body")
        (home / shot).parent.mkdir(exist_ok=True)
        bpy.context.scene.frame_set(5)
        bpy.data.objects["Moving"].location.z *= factor
        bpy.data.objects["Moving"].keyframe_insert("location", frame=5)
        saved(f"{home / shot}.blend")
        for _ in range(2):  # again, from a script: its own
            baked(folder=folder)
        moved[shot] = tip(bar, 3)
        bpy.ops.wm.save_mainfile()
    assert len(list(home.rglob("*.pc2"))) == 3
    for shot, height in moved.items():
        bpy.ops.wm.open_mainfile(filepath=f"{home / shot}.blend")
        assert tip(bpy.data.objects["Body"], 3) == pytest.approx(height, abs=1e-6), shot


def test_scenes_of_one_file_have_caches_of_their_own():
    bar, folder = saved_animation()
    baked()
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    for item in (bar, bpy.data.objects["Fixed"], bpy.data.objects["Moving"]):
        bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = bar
    baked()
    assert sorted(p.name for p in (folder / "cache").iterdir()) == [
        "scene~Other~Bar.pc2",
        "scene~Scene~Bar.pc2",
    ]


def patch(name):
    item = rider("MESH")
    item.name = name
    return item


ALIKE = ("a/b", "a_b", "a%2Fb", "a~b", "a\\b", "a:b", "a?b", "a b", "ä", "ae", "Scene~a", "x" * 63)


def test_names_that_are_alike_become_different_files():
    bar, folder = saved_animation()
    found = set()
    for name in (*ALIKE, *(f"{'ü' * 30}{n}" for n in range(3))):
        bar.name = name
        path = caches.cache_path(bar, bpy.context.scene, ".pc2", "//")
        assert (
            path.parent == folder and len(path.name.encode()) < 250 and not set(path.name) & set('/\\:*?"<>|')
        )
        path.write_bytes(b"")
        found.add(path)
    assert len(found) == len(ALIKE) + 3
    long = {caches.joined("f" * 100, "s" * 100, f"{'o' * 100}{n}") for n in range(9)}
    assert len(long) == 9 and all(len(name) <= caches.LONGEST for name in long)


def test_objects_whose_names_differ_by_what_files_lack_play_each_its_own():
    _, folder = saved_animation("a/b")
    saved_animation("a_b", folder)
    scenes.activate(*(bpy.data.objects[name] for name in ("a/b", "a_b")))
    baked(scope="SELECTED")
    files = {modifier_stack.find_cache(bpy.data.objects[name]).filepath for name in ("a/b", "a_b")}
    assert len(files) == 2 == len(list((folder / "cache").iterdir()))


def test_a_new_object_does_not_take_the_cache_of_one_that_was_renamed():
    bar, folder = saved_animation()
    baked()
    height, bar.name = tip(bar, 3), "Old"
    (cache,) = (folder / "cache").iterdir()
    content = cache.read_bytes()
    animated("Bar")
    with pytest.raises(RuntimeError, match=r"scene~Scene~Bar\.pc2 is there, and not of this object"):
        bpy.ops.arapfields.bake(start=1, end=2)
    assert cache.read_bytes() == content and tip(bar, 3) == height
    assert bpy.ops.arapfields.bake(start=1, end=2, overwrite=True) == {"FINISHED"}
    assert cache.read_bytes() != content


def test_a_given_file_of_another_is_refused_and_an_own_one_replaced():
    bar, folder = saved_animation()
    (foreign := folder / "mine.pc2").write_bytes(b"precious")
    for format, path in (("PC2", foreign), ("MDD", foreign.with_suffix(".mdd"))):
        path.write_bytes(b"precious")
        with pytest.raises(RuntimeError, match=f"{path.name} is there, and not of this object"):
            bpy.ops.arapfields.bake(start=1, end=2, format=format, filepath=str(path))
        assert path.read_bytes() == b"precious" and not bar.modifiers
    baked(filepath=str(folder / "own.pc2"))
    assert baked(filepath=str(folder / "own.pc2")) == "//own.pc2"
    baked(filepath=str(foreign), overwrite=True)
    assert np.isfinite(at(bar, 2)).all() and foreign.read_bytes()[:11] == b"POINTCACHE2"


def test_a_duplicate_that_plays_the_same_cache_is_no_obstacle():
    bar, _ = saved_animation()
    baked()
    copied = bar.copy()
    bpy.context.collection.objects.link(copied)
    scenes.activate(bar)
    assert baked() == modifier_stack.find_cache(copied).filepath


def test_carried_objects_keep_apart_from_objects_of_both_names():
    bar, folder = saved_animation()
    hat = patch("Hat")
    scenes.activate(hat, bar)
    bpy.ops.arapfields.carry()
    for name in ("Bar Hat", "Bar~Hat"):
        saved_animation(name, folder)
    scenes.activate(*(bpy.data.objects[name] for name in ("Bar", "Bar Hat", "Bar~Hat")))
    baked(scope="SELECTED")
    played = [
        modifier_stack.find_cache(bpy.data.objects[n]).filepath for n in ("Bar", "Hat", "Bar Hat", "Bar~Hat")
    ]
    assert len(set(played)) == 4 == len(list((folder / "cache").iterdir()))
    for name in ("Bar", "Hat"):
        bpy.data.objects[name].name = f"Old {name}"
    content = {path: path.read_bytes() for path in (folder / "cache").iterdir()}
    animated("Bar")
    hat = patch("Hat")
    scenes.activate(hat, bpy.data.objects["Bar"])
    bpy.ops.arapfields.carry()
    with pytest.raises(RuntimeError, match=r"Bar\.pc2, scene~Scene~Bar~Hat\.pc2 is there"):
        bpy.ops.arapfields.bake(start=1, end=2)
    assert content == {path: path.read_bytes() for path in (folder / "cache").iterdir()}
