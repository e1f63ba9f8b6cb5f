# SPDX-License-Identifier: GPL-3.0-or-later
"""A skinned file elsewhere: as glTF, in a Blender without the extension, and made by the command."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender.skins import person

ROOT = Path(__file__).resolve().parents[2]
# Without the extension: what is seen in some poses, and what the glTF exporter makes of them.
PLAY = """
import bpy, numpy as np, sys
from mathutils import Quaternion
source, target = sys.argv[-2:]
assert not bpy.context.preferences.filepaths.use_scripts_auto_execute
bpy.ops.wm.open_mainfile(filepath=source, use_scripts=False)
assert not hasattr(bpy.types.Object, "arapfields")
rig, body, seen = bpy.data.objects["Rig"], bpy.data.objects["Body"], []
scene = bpy.context.scene
scene.frame_start, scene.frame_end = 1, 3
random = np.random.default_rng(0)
for frame in (1, 2, 3):
    for bone in rig.pose.bones:
        bone.rotation_mode = "QUATERNION"
        bone.rotation_quaternion = Quaternion(random.normal(size=3).tolist(), (frame - 1) * 0.3)
        bone.keyframe_insert("rotation_quaternion", frame=frame)
for frame in (1, 2, 3):
    scene.frame_set(frame)
    mesh = body.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    seen.append([list(body.matrix_world @ vertex.co) for vertex in mesh.vertices])
keys = [key.value for key in body.data.shape_keys.key_blocks]
np.savez(target + ".npz", seen=seen, keys=keys)
if "{gltf}":
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    bpy.ops.export_scene.gltf(filepath=target + ".glb", export_yup=False, export_morph_normal=False,
                              export_frame_range=True, export_force_sampling=True, export_normals=False)
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=target + ".glb")
    item, again = next(one for one in bpy.data.objects if one.type == "MESH" and one.vertex_groups), []
    for key in item.data.shape_keys.key_blocks:
        key.slider_min = -1  # which the importer leaves at 0
    for frame in (1, 2, 3):
        bpy.context.scene.frame_set(frame)
        mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
        points = np.array([item.matrix_world @ vertex.co for vertex in mesh.vertices])
        again.append(points[:, [0, 2, 1]] * [1, 1, -1])  # exported with z up, read as y up
    np.savez(target + "_again.npz", again=again)
"""


def save_person(path):
    """In the worker."""
    person()
    bpy.ops.wm.save_as_mainfile(filepath=path)


def run_blender(text, environment, *arguments):
    done = subprocess.run(
        [sys.executable, "-c", text, *map(str, arguments)], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]


@pytest.fixture
def skinned(blender, command, tmp_path):
    """A .blend that the command has skinned."""
    source, target = tmp_path / "body.blend", tmp_path / "skinned.blend"
    blender.call(__file__, "save_person", {"path": source})
    call = ["skin", "-i", source, "-o", target, "--quiet"]
    done = command(*call, "--poses", 8, "--samples", 1000, "--correctives", 3)
    assert "bones move Body" in done.stdout
    named = command(*call, "--armature", "X", check=False)
    assert named.returncode == 2 and "--armature names one of: Rig" in named.stderr
    return target


def matrices(gltf, values, node, frame):
    """(4, 4) of a node in the world at a frame, from the animation's sampled channels."""
    own, parents = {}, {child: k for k, one in enumerate(gltf.nodes) for child in one.children or ()}
    for channel in gltf.animations[0].channels:
        if channel.target.node == node:
            sampler = gltf.animations[0].samplers[channel.sampler]
            own[channel.target.path] = values(sampler.output)[min(frame, len(values(sampler.output)) - 1)]
    one, result = gltf.nodes[node], np.eye(4)
    x, y, z, w = own.get("rotation", one.rotation or (0, 0, 0, 1))
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    result[:3, :3] = turn * np.asarray(own.get("scale", one.scale or (1, 1, 1)))
    result[:3, 3] = own.get("translation", one.translation or (0, 0, 0))
    return matrices(gltf, values, parents[node], frame) @ result if node in parents else result


def test_it_plays_bit_for_bit_without_the_extension_and_as_gltf(skinned, user_folder, tmp_path):
    """The glTF by an independent reader, skinned in NumPy."""
    register = f"import sys; sys.path[:0] = [{str(ROOT)!r}]\nimport addon\naddon.register()\n"
    beside = PLAY.format(gltf="").replace("assert not hasattr", "assert hasattr")
    run_blender(register + beside, user_folder, skinned, tmp_path / "with")
    run_blender(PLAY.format(gltf="yes"), user_folder, skinned, tmp_path / "play")
    with np.load(tmp_path / "play.npz") as played, np.load(tmp_path / "with.npz") as other:
        seen = played["seen"]
        assert seen.tobytes() == other["seen"].tobytes() and np.abs(played["keys"]).max() > 0.05
    with np.load(tmp_path / "play_again.npz") as read_back:
        for points, expected in zip(read_back["again"], seen, strict=True):  # Blender's importer
            off = np.linalg.norm(points[:, None] - expected, axis=2).min(axis=1)
            assert off.max() < 1e-5 * np.ptp(seen[0], axis=0).max()
    pygltflib = pytest.importorskip("pygltflib")
    gltf = pygltflib.GLTF2().load(str(tmp_path / "play.glb"))
    kinds = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
    widths = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}

    def read(place, count, component, width=1):
        view, kind = gltf.bufferViews[place.bufferView], np.dtype(kinds[component])
        begin = (view.byteOffset or 0) + (place.byteOffset or 0)
        data = gltf.binary_blob()[begin : begin + count * width * kind.itemsize]
        return np.frombuffer(data, kind).reshape(count, width)

    def values(index):
        accessor = gltf.accessors[index]
        kind, width, sparse = accessor.componentType, widths[accessor.type], accessor.sparse
        found = np.zeros((accessor.count, width))
        if accessor.bufferView is not None:
            found[:] = read(accessor, accessor.count, kind, width)
        if sparse is not None:
            rows = read(sparse.indices, sparse.count, sparse.indices.componentType)[:, 0]
            found[rows] = read(sparse.values, sparse.count, kind, width)
        return found

    node = next(k for k, one in enumerate(gltf.nodes) if one.mesh is not None)
    (primitive,) = gltf.meshes[gltf.nodes[node].mesh].primitives
    skin = gltf.skins[gltf.nodes[node].skin]
    binds = values(skin.inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    rest, joints = values(primitive.attributes.POSITION), values(primitive.attributes.JOINTS_0).astype(int)
    shares = values(primitive.attributes.WEIGHTS_0)
    morphs = np.array([values(target["POSITION"]) for target in primitive.targets])
    weights = next(
        values(gltf.animations[0].samplers[channel.sampler].output).reshape(-1, len(morphs))
        for channel in gltf.animations[0].channels
        if channel.target.path == "weights"
    )
    for frame in range(3):
        moved = [
            matrices(gltf, values, joint, frame) @ bind
            for joint, bind in zip(skin.joints, binds, strict=True)
        ]
        points = rest + np.einsum("k,kni->ni", weights[frame], morphs)
        blend = np.einsum("nj,njab->nab", shares, np.array(moved)[joints])
        posed = np.einsum("nab,nb->na", blend, np.c_[points, np.ones(len(points))])[:, :3]
        off = np.linalg.norm(posed[:, None] - seen[frame], axis=2).min(axis=1)
        assert off.max() < 1e-5 * np.ptp(seen[0], axis=0).max(), frame
