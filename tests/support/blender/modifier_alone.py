# SPDX-License-Identifier: GPL-3.0-or-later
"""Script for any Blender, without the native library: the modifier and its inputs, with given offsets, and
copies of modifiers.

blender -b --factory-startup --python tests/support/blender/modifier_alone.py
or with PyPI's bpy: python tests/support/blender/modifier_alone.py
"""

import os
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from support.blender import scenes  # noqa: E402

import addon  # noqa: E402
from addon.blender import modifier_stack, references  # noqa: E402
from addon.field_modifier import motion, node_group  # noqa: E402

EXACT = 1e-6  # single precision of positions of size one


def points(item):
    mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    return flat.reshape(-1, 3)


def offsets(count):
    return np.random.default_rng(0).normal(size=(count, 3)).astype(np.float32)


def check_inputs():
    bar = scenes.bar()
    rest, given = points(bar), offsets(len(bar.data.vertices))
    modifier = motion.bind(bpy.context, bar)
    motion.write(bar, motion.Motion(given))
    assert np.abs(points(bar) - (rest + given)).max() < EXACT
    node_group.put(modifier, "Factor", 0.5)
    assert (
        np.abs(points(bar) - (rest + given / 2)).max() < EXACT and node_group.get(modifier, "Factor") == 0.5
    )
    group = bar.vertex_groups.new(name="Some")
    group.add(list(range(100)), 1.0, "REPLACE")
    node_group.put_attribute(modifier, "Mask", "Some")
    assert node_group.get_attribute(modifier, "Mask") == "Some"
    masked = points(bar)
    assert masked[100:].tobytes() == rest[100:].tobytes()
    assert np.abs(masked[:100] - (rest + given / 2)[:100]).max() < EXACT
    if bpy.app.version >= (4, 5, 0):
        motion.choose_group(modifier, "POINT", {})
    assert node_group.get(modifier, "Factor") == 0.5 and node_group.get_attribute(modifier, "Mask") == "Some"
    node_group.put_attribute(modifier, "Mask", "")
    assert np.abs(points(bar) - (rest + given / 2)).max() < EXACT
    modifier.show_viewport = False
    assert points(bar).tobytes() == rest.tobytes()
    motion.remove(bar)
    assert not bar.modifiers and not bpy.data.node_groups and points(bar).tobytes() == rest.tobytes()


def check_helper():
    """A helper after Mirror survives a file; a copy of the object shares it until it has its own motion."""
    bar = scenes.bar("Mirrored")
    mirror = bar.modifiers.new("Mirror", "MIRROR")
    mirror.use_axis, mirror.use_mirror_merge = (False, False, True), False
    bpy.context.view_layer.update()
    rest = points(bar)
    given = offsets(len(rest))
    motion.bind(bpy.context, bar)
    motion.write(bar, motion.Motion(given))
    assert np.abs(points(bar) - (rest + given)).max() < EXACT
    copied = bar.copy()
    copied.name = "Copied"
    bpy.context.collection.objects.link(copied)
    motion.bind(bpy.context, copied)
    motion.write(copied, motion.Motion(-given))
    path = tempfile.mktemp(suffix=".blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    for name, sign in (("Mirrored", 1), ("Copied", -1)):
        assert np.abs(points(bpy.data.objects[name]) - (rest + sign * given)).max() < EXACT, name


def check_free_normals():
    bar = scenes.bar("Normals")
    count = len(bar.data.vertices)
    attribute = bar.data.attributes.new("custom_normal", "FLOAT_VECTOR", "POINT")
    given = offsets(count)
    given /= np.linalg.norm(given, axis=1, keepdims=True)
    attribute.data.foreach_set("vector", given.ravel())
    motion.bind(bpy.context, bar)
    turns = np.tile(np.array([0, 0, np.pi / 2], np.float32), (count, 1))
    motion.write(bar, motion.Motion(np.zeros((count, 3), np.float32), turns))
    mesh = bar.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    flat = np.empty(3 * count, np.float32)
    mesh.attributes["custom_normal"].data.foreach_get("vector", flat)
    expected = np.stack([-given[:, 1], given[:, 0], given[:, 2]], axis=1)
    assert np.abs(flat.reshape(-1, 3) - expected).max() < EXACT


def check_copies():
    read, twin, other, made = (scenes.bar(name) for name in ("Read", "Twin", "Other", "Made"))
    other.modifiers.new("Laid", "SHRINKWRAP").target = read
    nodes = scenes.reading_nodes(other, read)
    node_group.put(nodes, "Share", 0.25)
    node_group.put_attribute(nodes, "Share", "Some")
    references.copy_modifiers(made, other.modifiers)
    references.remap(references.parts_of(made), {read: twin})
    copied = made.modifiers["Nodes"]
    assert made.modifiers["Laid"].target == node_group.get(copied, "Goal") == twin
    assert other.modifiers["Laid"].target == node_group.get(nodes, "Goal") == read
    assert node_group.get(copied, "Share") == 0.25 and node_group.get_attribute(copied, "Share") == "Some"


bpy.ops.wm.read_factory_settings(use_empty=True)
addon.register()
check_inputs()
check_copies()
check_helper()
if bpy.app.version >= (4, 5, 0):
    check_free_normals()
assert len(bpy.data.scenes) == 1 and modifier_stack.find(bpy.data.objects["Mirrored"]) is not None
print("modifier works in", bpy.app.version_string, flush=True)
os._exit(0)  # bpy 4.2 crashes at its end: see installed.py
