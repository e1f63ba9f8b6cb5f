# SPDX-License-Identifier: GPL-3.0-or-later
"""Many wraps inside Blender: a template that follows a scanned motion, and pages of pictures."""

import tempfile
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes
    from support.blender.baking import EXACT, at, cache_file, cancelled_at, stepped
    from support.blender.wraps import SMALL, bar_and_target, rigged_bar, soup_of
    from support.geometry import wrap_cases as cases

    import arapfields as af
    from addon.animation.operators import ARAPFIELDS_OT_wrap_sequence
    from addon.core.runtime import jobs
    from arapfields.cli import contact_sheet

pytestmark = pytest.mark.in_blender

OFF = 0.01  # of the diagonal, on average: few centers and samples
RATES = (0.0, 0.1, 0.2, 0.3)  # at which the scan is bent in frames 2, 4, 6 and 8


def link(name, vertices, faces, collection=None):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    item = bpy.data.objects.new(name, mesh)
    (collection or bpy.context.collection).objects.link(item)
    return item


def template():
    """A coarse figure that lies elsewhere, scaled unevenly, with a material."""
    item = link("Template", *cases.figure(2))
    item.location, item.scale = (0.1, 0, 0), (1.1, 1, 1)
    item.data.materials.append(bpy.data.materials.new("Skin"))
    for name, value in SMALL.items():
        setattr(item.arapfields.wrap, name, value)
    scenes.activate(item)
    return item


def bent(rate):
    return cases.bend(cases.figure(3)[0], rate)


def scans(missing=(), empty=()):
    """A template whose frames are scans in a collection, which a layer does not show."""
    item, faces = template(), cases.figure(3)[1]
    item.arapfields.wrap.frames = home = bpy.data.collections.new("Scans")
    bpy.context.scene.collection.children.link(home)
    bpy.context.view_layer.layer_collection.children["Scans"].exclude = True
    for number, rate in zip((2, 4, 6, 8), RATES, strict=True):
        if number in empty:
            link(f"scan_{number}", np.empty((0, 3)), np.empty((0, 3), int), home)
        elif number not in missing:
            link(f"scan_{number}", bent(rate), faces, home)
    return item


def off(item, frame, rate):
    """Mean distance of an object at a frame from the scan that is bent so, in diagonals of that."""
    at(item, frame)
    away = af.MeshSdf(bent(rate), cases.figure(3)[1])(scenes.world_points(item))
    return np.abs(away).mean() / np.linalg.norm(np.ptp(bent(rate), axis=0))


def test_a_template_follows_a_collection_and_names_what_is_missing():
    item = scans(missing=(4,), empty=(6,))
    path = cache_file()
    bpy.context.scene.frame_set(3)
    assert bpy.ops.arapfields.wrap_sequence(filepath=path) == {"FINISHED"}
    assert bpy.context.scene.frame_current == 3
    assert [m.type for m in item.modifiers] == ["MESH_CACHE"]
    assert off(item, 2, 0.0) < OFF and off(item, 8, 0.3) < OFF
    assert np.array_equal(at(item, 4), at(item, 2)) and np.array_equal(at(item, 6), at(item, 2))
    said = dict(reversed(pair) for pair in jobs.messages())
    assert "Template: Frame 4: There is no mesh; held" in said, said
    assert "Template: Frame 6: scan_6: the mesh is empty; held" in said, said
    assert any("4 frames of 66 points baked" in text and "at worst, in frame" in text for text in said), said
    assert bpy.ops.arapfields.remove_bake() == {"FINISHED"} and not item.modifiers


def test_bad_frames_at_the_beginning_have_the_first_good_shape():
    item = scans(empty=(2, 4))
    assert bpy.ops.arapfields.wrap_sequence(filepath=cache_file()) == {"FINISHED"}
    assert np.array_equal(at(item, 2), at(item, 6)) and np.array_equal(at(item, 4), at(item, 6))
    assert off(item, 6, 0.2) < OFF and off(item, 8, 0.3) < OFF
    said = {text for _, text in jobs.messages()}
    assert "Template: Frame 2: scan_2: the mesh is empty; held" in said, said


def test_a_pose_does_not_add_to_what_is_scanned():
    """Wrapped once, the field stands before the armature; a scan has its own pose."""
    item, rig = rigged_bar()
    for name, value in SMALL.items():
        setattr(item.arapfields.wrap, name, value)
    target = soup_of(item)
    item.arapfields.wrap.onto = target
    assert bpy.ops.arapfields.wrap() == {"FINISHED"}
    rig.pose.bones["Upper"].rotation_mode = "XYZ"
    rig.pose.bones["Upper"].rotation_euler.x = 0.8
    assert bpy.ops.arapfields.wrap_sequence(filepath=cache_file(), start=1, end=1) == {"FINISHED"}
    assert [m.type for m in item.modifiers if m.show_viewport] == ["ARMATURE", "MESH_CACHE"]
    goal = scenes.world_points(target)
    triangles = np.arange(len(goal)).reshape(-1, 3).astype(np.int32)
    away = np.abs(af.MeshSdf(goal, triangles)(scenes.world_points(item))).mean()
    assert away < OFF * np.linalg.norm(np.ptp(goal, axis=0))


def test_a_target_that_changes_is_followed_into_shape_keys():
    item, target = template(), link("Scan", *cases.figure(3))
    item.arapfields.wrap.onto = target
    target.shape_key_add(name="Basis")
    key = target.shape_key_add(name="Bent")
    for point, place in zip(key.data, bent(0.3), strict=True):
        point.co = place
    for frame, value in ((1, 0.0), (3, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    before = at(item, 1)
    assert bpy.ops.arapfields.wrap_sequence(format="KEYS", range="HANDLES") == {"FINISHED"}
    baked = bpy.data.objects["Template_baked"]
    assert [k.name for k in baked.data.shape_keys.key_blocks[1:]] == ["frame 1", "frame 2", "frame 3"]
    assert off(baked, 1, 0.0) < OFF and off(baked, 3, 0.3) < OFF
    assert np.array_equal(at(item, 1), before) and baked.data.materials[0].name == "Skin"


def test_a_cancelled_sequence_leaves_nothing():
    item = scans()
    kept = scenes.everything(item)
    operator = stepped(ARAPFIELDS_OT_wrap_sequence, filepath=cache_file())
    assert cancelled_at(operator, "frame 4") == {"CANCELLED"}
    assert operator.said == "Wrap Sequence cancelled"
    assert scenes.everything(item) == kept and not item.modifiers


def wraps(**given):
    """How many of its frames a sequence wraps: of the others it does not look at the scan's distances."""
    with patch.object(af, "MeshSdf", side_effect=af.MeshSdf) as made:
        assert bpy.ops.arapfields.wrap_sequence(**given) == {"FINISHED"}
    return made.call_count


def played(item):
    return [at(item, frame).tolist() for frame in (2, 4, 6, 8)]


@pytest.mark.parametrize("kept", ["cache", "keys"])
def test_a_stopped_sequence_goes_on_as_if_it_had_not_been(kept):
    item = scans()
    given = {"filepath": cache_file()} if kept == "cache" else {"format": "KEYS"}
    assert cancelled_at(stepped(ARAPFIELDS_OT_wrap_sequence, **given), "frame 6") == {"CANCELLED"}
    count = wraps(**given)
    assert 1 <= count <= 2
    said = " ".join(text for _, text in jobs.messages())
    assert f"{4 - count} frames were there already" in said, said
    shown = played(item if kept == "cache" else bpy.data.objects["Template_baked"])
    scenes.activate(item)
    assert wraps(filepath=cache_file()) == 4
    assert np.abs(np.subtract(played(item), shown)).max() < EXACT


@pytest.mark.parametrize(("edited", "redone"), [(8, 1), (4, 3)])
def test_an_edited_frame_is_wrapped_again_with_those_behind_it(edited, redone):
    path, clothes = Path(cache_file()), scenes.bar("Clothes")
    item, file = scans(), str(path.with_name("scene.blend"))
    item.arapfields.carried.add().item = clothes
    assert wraps(filepath=str(path)) == 4
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.open_mainfile(filepath=file)
    item, clothes = bpy.data.objects["Template"], bpy.data.objects["Clothes"]
    scenes.activate(item)
    for vertex, place in zip(bpy.data.objects[f"scan_{edited}"].data.vertices, bent(0.12), strict=True):
        vertex.co = place
    assert wraps(filepath=str(path)) == redone
    assert off(item, edited, 0.12) < OFF
    shown, other = (played(item), played(clothes)), cache_file()
    assert wraps(filepath=other) == 4
    assert (played(item), played(clothes)) == shown and Path(other).read_bytes() == path.read_bytes()


def test_what_has_no_frames_is_refused():
    item = template()
    with pytest.raises(RuntimeError, match="Choose the object to wrap Template onto"):
        bpy.ops.arapfields.wrap_sequence(format="KEYS")
    item.arapfields.wrap.frames = home = bpy.data.collections.new("Scans")
    with pytest.raises(RuntimeError, match="Scans has no mesh for these frames"):
        bpy.ops.arapfields.wrap_sequence(format="KEYS")
    link("scan_1", np.empty((0, 3)), np.empty((0, 3), int), home)
    with pytest.raises(RuntimeError, match="Frame 1: scan_1: the mesh is empty"):
        bpy.ops.arapfields.wrap_sequence(format="KEYS")


def test_names_without_numbers_are_in_order_and_a_setting_wraps_all_anew():
    item = template()
    item.arapfields.wrap.frames = home = bpy.data.collections.new("Scans")
    for name, rate in (("Scan.001", 0.2), ("Scan", 0.0)):
        link(name, bent(rate), cases.figure(3)[1], home)
    bpy.context.scene.frame_start = 10
    path = cache_file()
    assert wraps(filepath=path) == 2
    assert off(item, 10, 0.0) < OFF and off(item, 11, 0.2) < OFF
    assert wraps(filepath=path) == 0
    item.arapfields.wrap.closeness = 0.5  # another setting wraps all anew
    assert wraps(filepath=path) == 2


def test_a_page_shows_what_is_wrapped_the_worst_first():
    item, target = bar_and_target()
    other, plain = scenes.bar("Loose"), scenes.bar("Plain")
    other.arapfields.wrap.onto = target
    for one, closeness in ((item, 1.0), (other, 0.01)):
        scenes.activate(one)
        assert bpy.ops.arapfields.wrap(closeness=closeness, **SMALL) == {"FINISHED"}
    scenes.activate(plain, item, other)
    with pytest.raises(RuntimeError, match="Save the"):
        bpy.ops.arapfields.wrap_sheet()
    path, drawn, cell = Path(tempfile.mkdtemp()) / "wraps.html", [], contact_sheet.cell
    contact_sheet.cell = lambda *given: drawn.append(given[2:]) or cell(*given)
    assert bpy.ops.arapfields.wrap_sheet(filepath=str(path), scope="SELECTED") == {"FINISHED"}
    contact_sheet.cell = cell
    for wrapped, there in drawn:
        assert np.abs(af.MeshSdf(*there)(wrapped[0])).mean() < 0.02
    page = path.read_text()
    assert 0 < page.index("<b>Loose, Scan</b>") < page.index("<b>Bar, Scan</b>") and "Plain" not in page
    assert page.count("of the target's size off".replace("'", "&#x27;")) == page.count("<img") == 2
    assert any(text.startswith("Wrap Plain first") for _, text in jobs.messages()), jobs.messages()
    with pytest.raises(RuntimeError, match=r"Error: .*gone.html: \w"):
        bpy.ops.arapfields.wrap_sheet(filepath=str(path / "gone.html"))
