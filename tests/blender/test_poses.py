# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses: a field that was solved on one mesh moves others of the same shape."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

import arapfields as af

if IN_BLENDER:
    import bpy
    from mathutils import Matrix
    from support.blender import scenes
    from support.blender.live import step
    from support.blender.riders import link, rider, shown

pytestmark = pytest.mark.in_blender


def creature(name, cuts):
    """A wavy body of revolution along x, as finely divided as `cuts` says."""
    across, around = 4 * cuts, 2 * cuts
    x, a = np.meshgrid(
        np.linspace(-1, 1, across), np.linspace(0, 2 * np.pi, around, endpoint=False), indexing="ij"
    )
    radius = (0.2 + 0.05 * np.cos(7 * x)) * np.sqrt(np.maximum(1e-4, 1 - x**8))
    points = np.stack([x, radius * np.cos(a), radius * np.sin(a)], axis=-1).reshape(-1, 3)
    index = np.arange(across * around).reshape(across, around)
    following = np.roll(index, -1, axis=1)
    faces = np.stack([index[:-1], index[1:], following[1:], following[:-1]], axis=-1).reshape(-1, 4).tolist()
    faces += [following[0][::-1].tolist(), following[-1].tolist()]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), [], faces)
    item = link(name, mesh)
    bpy.context.view_layer.update()
    return item


def saved(source):
    """Deforms a creature and saves the pose "Bent"; returns how far its points moved."""
    rest = scenes.world_points(source)
    fixed = scenes.cube_empty((-1.0, 0, 0), (0.3, 0.5, 0.5), "Fixed")
    moving = scenes.cube_empty((1.0, 0, 0), (0.3, 0.5, 0.5), "Moving")
    bpy.context.view_layer.update()
    scenes.activate(fixed, moving, source)
    bpy.ops.arapfields.add_handle()
    moving.location.z, moving.rotation_euler.y = 0.4, -0.5
    scenes.activate(source)
    assert bpy.ops.arapfields.deform(field="radial", samples=1000) == {"FINISHED"}
    assert bpy.ops.arapfields.save_pose(pose="Bent") == {"FINISHED"}
    return float(np.linalg.norm(scenes.world_points(source) - rest, axis=1).max())


def damaged(content):
    """Bytes like a file's, damaged in many ways."""
    random = np.random.default_rng(0)
    yield from (b"", b"x", content[:-1], content[: len(content) // 2], content[7:], content + b"x")
    yield np.lib.format.magic(1, 0) + b"\x10\0" + b"{" * 16
    for _ in range(200):
        flipped = bytearray(content)
        for at in random.integers(len(content), size=random.integers(1, 7)):
            flipped[at] ^= 1 << random.integers(8)
        yield bytes(flipped)
    for at in range(0, 140, 3):  # the first entry's header
        yield content[:at] + bytes([content[at] ^ 0xFF]) + content[at + 1 :]


def test_a_damaged_pose_is_refused_in_one_sentence():
    saved(creature("Body", 6))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "bent.arappose")
        assert bpy.ops.arapfields.export_pose(filepath=str(path)) == {"FINISHED"}
        content, refused = path.read_bytes(), 0
        for number, changed in enumerate(damaged(content)):
            path.write_bytes(changed)
            try:
                bpy.ops.arapfields.import_pose(filepath=str(path))
            except RuntimeError as error:
                refused += 1
                assert "bent.arappose" in str(error) and "Traceback" not in str(error), number
        assert refused > 200


def test_poses_whose_names_end_alike_get_files_of_their_own():
    saved(creature("Body", 6))
    with tempfile.TemporaryDirectory() as folder:
        (beside := Path(folder, "jump.1.arappose.partial")).write_text("somebody's own")
        for name in ("jump.1", "jump.2", "jump.arappose", "Leap.ARAPPOSE"):
            assert bpy.ops.arapfields.export_pose(filepath=str(Path(folder, name))) == {"FINISHED"}
        names = {path.name for path in Path(folder).iterdir()} - {beside.name}
        assert names == {"jump.1.arappose", "jump.2.arappose", "jump.arappose", "Leap.ARAPPOSE"}
        assert beside.read_text() == "somebody's own"


def test_a_pose_fits_other_resolutions():
    source = creature("Body", 50)
    assert len(source.data.vertices) == 20_000
    others = [creature("Coarse", 16), creature("Fine", 158)]
    assert [len(item.data.vertices) for item in others] == [2048, 199_712]
    motion = saved(source)
    before, after = {}, {}
    for item in (source, *others):
        before[item.name] = np.array([vertex.co for vertex in item.data.vertices])
    for item in others:
        scenes.activate(item)
        assert bpy.ops.arapfields.apply_pose(pose="Bent") == {"FINISHED"}
    for item in (source, *others):
        after[item.name] = scenes.world_points(item)
    source.data.calc_loop_triangles()
    triangles = np.array([triangle.vertices for triangle in source.data.loop_triangles])
    for item in others:
        some = slice(None, None, max(1, len(before[item.name]) // 3000))
        apart = [
            np.abs(af.signed_distance(points["Body"], triangles, points[item.name][some]))
            for points in (before, after)
        ]
        assert (apart[1] - apart[0]).max() <= 0.01 * motion, item.name
        assert np.abs(after[item.name] - before[item.name]).max() > 0.3


def test_strength_files_and_refusals():
    source, other = creature("Body", 16), creature("Other", 20)
    patch = rider("MESH")
    scenes.activate(patch, other)
    bpy.ops.arapfields.carry()
    with pytest.raises(RuntimeError, match="Deform Other first"):
        bpy.ops.arapfields.save_pose()
    saved(source)
    rest, of_patch = np.array([v.co for v in other.data.vertices]), shown(patch)
    scenes.activate(other)
    shifts, patches = [], []
    for strength in (1.0, 0.5):
        bpy.ops.arapfields.apply_pose(strength=strength)
        shifts.append(scenes.world_points(other) - rest)
        patches.append(shown(patch) - of_patch)
    assert np.abs(shifts[0] - 2 * shifts[1]).max() < 1e-5 and np.abs(shifts[0]).max() > 0.3
    assert np.abs(patches[0] - 2 * patches[1]).max() < 1e-5 and np.abs(patches[0]).max() > 0.3

    path = Path(tempfile.mkdtemp()) / "bent.arappose"
    assert bpy.ops.arapfields.export_pose(filepath=str(path)) == {"FINISHED"} and path.stat().st_size < 1e6
    bpy.ops.arapfields.remove_pose()
    with pytest.raises(RuntimeError, match="Save a pose first"):
        bpy.ops.arapfields.apply_pose()
    assert bpy.ops.arapfields.apply_pose(filepath=str(path)) == {"FINISHED"}
    assert np.abs(scenes.world_points(other) - rest - shifts[0]).max() < 1e-6
    assert bpy.ops.arapfields.import_pose(filepath=str(path)) == {"FINISHED"}
    assert bpy.context.scene.arapfields.poses.keys() == ["bent"]

    held = scenes.world_points(other)
    other.data.transform(Matrix.Translation((0, 3, 0)))
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match=r"Other lies outside of the pose's field.*100 % of them"):
        bpy.ops.arapfields.apply_pose(pose="bent")
    other.data.transform(Matrix.Translation((0, -3, 0)))
    assert np.abs(scenes.world_points(other) - held).max() < 1e-5
    content = path.read_bytes()
    for broken in (b"", content[: len(content) // 2], b"PK" + content[2:100], b"nonsense" * 50):
        path.write_bytes(broken)
        with pytest.raises(RuntimeError, match="holds no pose"):
            bpy.ops.arapfields.import_pose(filepath=str(path))
    with pytest.raises(RuntimeError, match=r"none\.arappose: No such file"):
        bpy.ops.arapfields.import_pose(filepath=str(path.with_name("none.arappose")))


def test_a_live_shape_is_saved():
    bar, _, moving = scenes.bar_with_handles()
    rest = scenes.world_points(bar)
    bpy.ops.arapfields.live()
    moving.location.z += 0.4
    step(refined=True)
    shown = scenes.world_points(bar)
    assert bpy.ops.arapfields.save_pose(pose="Raised") == {"FINISHED"}
    bpy.ops.arapfields.live()
    assert np.abs(scenes.world_points(bar) - rest).max() < 1e-6
    bpy.ops.arapfields.apply_pose(pose="Raised")
    assert np.abs(scenes.world_points(bar) - shown).max() < 1e-4
