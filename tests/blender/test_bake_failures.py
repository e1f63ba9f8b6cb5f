# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes that cannot be: each is named, and the last good cache stays."""

import os
import tempfile

import pytest
from support.blender.inside import IN_BLENDER
from support.files.full_disk import files_of_at_most

if IN_BLENDER:
    import bpy
    from support.blender.baking import animated, cancelled_at, saved_animation, stepped

    from addon.animation import played
    from addon.core.runtime import jobs
    from addon.core.runtime.coroutines import Pause, run_to_completion

pytestmark = pytest.mark.in_blender


def test_whatever_goes_wrong_is_named_and_the_last_good_cache_stays():
    _, folder = saved_animation()
    bpy.ops.arapfields.bake(start=1, end=3)
    path = folder / "cache/scene~Scene~Bar.pc2"
    good = path.read_bytes()

    def fails(text, **arguments):
        with pytest.raises(RuntimeError, match=text):
            bpy.ops.arapfields.bake(**arguments)
        assert path.read_bytes() == good and [p.name for p in path.parent.iterdir()] == [path.name]

    fails("The last frame, 3, comes before the first, 7", start=7, end=3)
    fails("no such folder", start=1, end=2, filepath="//gone/too/Bar.pc2")
    fails("needs the extension .mdd", start=1, end=2, format="MDD", filepath="//cache/Bar.pc2")
    with files_of_at_most(9000):
        fails(path.name, start=1, end=5)
    operator = stepped(format="PC2", start=1, end=5, folder="//cache")
    assert cancelled_at(operator, "frame 3") == {"CANCELLED"}
    assert path.read_bytes() == good and os.listdir(path.parent) == [path.name]
    for handle in ("Fixed", "Moving"):
        bpy.data.objects[handle].animation_data_clear()
    fails("Nothing that moves Bar is animated", range="HANDLES")


@pytest.mark.parametrize("stage", ["frame 1", "frame 3"])
def test_a_cancelled_bake_leaves_no_folder_of_its_own(stage):
    _, folder = saved_animation()
    assert cancelled_at(stepped(format="PC2", start=1, end=5, folder="//cache"), stage) == {"CANCELLED"}
    assert not (folder / "cache").exists()
    (folder / "cache").mkdir()  # the user's
    assert cancelled_at(stepped(format="PC2", start=1, end=5, folder="//cache"), stage) == {"CANCELLED"}
    assert os.listdir(folder / "cache") == []


def test_modifiers_that_make_other_vertices_as_frames_pass_are_named():
    bar = animated()
    subdivision = bar.modifiers.new("Subdivision", "SUBSURF")
    for frame, levels in ((1, 1), (3, 2)):
        subdivision.levels = levels
        subdivision.keyframe_insert("levels", frame=frame)
    bar.arapfields.result = "NEW"
    bpy.context.scene.frame_set(1)
    with pytest.raises(RuntimeError, match="Bar: modifiers before the field make other numbers of vertices"):
        bpy.ops.arapfields.bake(start=1, end=5, format="KEYS")


def test_a_bake_that_no_longer_fits_is_named():
    bar, folder = saved_animation()
    assert bpy.ops.arapfields.bake(range="HANDLES") == {"FINISHED"}
    assert played.record_of(bar)["frames"] == 5 and played.problem(bar, look_closely=True) is None
    bar.data.vertices[0].co.x += 0.1
    assert "mesh changed since the bake" in str(played.problem(bar, look_closely=True))
    bar.data.vertices[0].co.x -= 0.1
    (folder / "cache/scene~Scene~Bar.pc2").rename(folder / "cache/moved.pc2")
    assert "is not there" in str(played.problem(bar))
    bar.modifiers[0].filepath = "//cache/moved.pc2"
    content = (folder / "cache/moved.pc2").read_bytes()
    (folder / "cache/moved.pc2").write_bytes(content[:-1])
    assert "bytes" in str(played.problem(bar, look_closely=True))


@pytest.mark.parametrize("kind", ["deleted", "changed"])
def test_an_object_is_named_once(kind):
    bar, folder = saved_animation()
    operator = stepped(start=1, end=3, filepath=str(folder / "Bar.pc2"))
    coroutine = operator.coroutine(bpy.context)
    while next(coroutine) is not Pause.WORKER:
        pass
    if kind == "deleted":
        bpy.data.objects.remove(bar)
    else:
        bar.data.vertices[0].co.x += 0.1
    run_to_completion(coroutine, wait=lambda: jobs.running().join(0.05))
    jobs.stop()
    assert operator.said.startswith("Bar ") and operator.said.count("Bar") == 1, operator.said


def test_an_unsaved_file_asks_for_a_place():
    animated()
    with pytest.raises(RuntimeError, match=r"Save the \.blend first"):
        bpy.ops.arapfields.bake(start=1, end=2)
    path = os.path.join(tempfile.mkdtemp(), "anywhere.pc2")
    assert bpy.ops.arapfields.bake(start=1, end=2, filepath=path) == {"FINISHED"}
    assert bpy.data.objects["Bar"].modifiers[0].filepath == path
