# SPDX-License-Identifier: GPL-3.0-or-later
"""Scans of Gaussian splats as importers leave them, with handles at both ends."""

import bpy
import numpy as np
from support.blender import scenes

import arapfields as af


def given(count=800, harmonics=16):
    """Flat splats on a bar from -1 to 1 along x."""
    rng = np.random.default_rng(0)
    x, angle = rng.uniform(-1, 1, count), rng.uniform(0, 2 * np.pi, count)
    normals = np.column_stack([0 * x, np.cos(angle), np.sin(angle)])
    turns = np.column_stack([1 + normals[:, 2] + 1e-9, -normals[:, 1], normals[:, 0], 0 * x])
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    scales = 0.03 * np.array([1.0, 0.7, 0.1]) * rng.uniform(0.9, 1.1, (count, 3))
    colours = 0.25 * rng.normal(size=(count, harmonics, 3))
    return af.GaussianSplats(
        np.column_stack([x, 0.2 * normals[:, 1:]]), turns, scales, np.full(count, 0.9), colours
    )


def file_values(splats):
    """As Blender's PLY import and KIRI's 3DGS Render name them: one number an attribute."""
    colours = np.asarray(splats.harmonics)
    rest = colours[:, 1:].swapaxes(1, 2).reshape(len(splats), -1)
    columns = {f"rot_{k}": splats.rotations[:, k] for k in range(4)}
    columns |= {f"scale_{k}": np.log(splats.scales[:, k]) for k in range(3)}
    columns |= {f"f_dc_{k}": colours[:, 0, k] for k in range(3)}
    columns |= {f"f_rest_{k}": rest[:, k] for k in range(rest.shape[1])}
    return columns | {"opacity": np.log(splats.opacities / (1 - splats.opacities))}


def vector_values(splats):
    """As ReshotAI's add-on names them."""
    q = splats.rotations
    columns = {"quatxyz": q[:, :3], "quatw": q[:, 3], "rot_euler": np.zeros((len(q), 3))}
    columns |= {"scale": splats.scales, "logscale": np.log(splats.scales), "opacity": splats.opacities}
    return columns | {f"sh{k}": splats.harmonics[:, k] for k in range(splats.harmonics.shape[1])}


def own_values(splats):
    """As Blender's own PLY import names them from 5.3 on, where colours are FLOAT4."""
    base = np.column_stack([splats.harmonics[:, 0], splats.opacities])
    columns = {"rotation": splats.rotations, "scale": splats.scales, "radiance:base": base}
    return columns | {f"radiance:sh_{k - 1}": splats.harmonics[:, k] for k in range(1, 16)}


def kind_of(key, column):
    """(type of an attribute, name of its values)"""
    plain = ("FLOAT", "value") if column.ndim == 1 else ("FLOAT_VECTOR", "vector")
    return {"rotation": ("QUATERNION", "value"), "radiance:base": ("FLOAT_COLOR", "color")}.get(key, plain)


def scan(splats, values, data="MESH"):
    """An object of splats, held at its left end; its right end follows a handle. (scan, moving)"""
    mesh = bpy.data.meshes.new("Scan")
    mesh.from_pydata(splats.centers.tolist(), [], [])
    for key, column in values(splats).items():
        kind, field = kind_of(key, column)
        mesh.attributes.new(key, kind, "POINT").data.foreach_set(field, np.asarray(column, "f4").ravel())
    item = bpy.data.objects.new("Scan", mesh)
    bpy.context.scene.collection.objects.link(item)
    if data == "POINTCLOUD":
        scenes.activate(item)
        kinds = bpy.ops.object.convert.get_rna_type().properties["target"].enum_items
        if "POINTCLOUD" not in kinds:
            import pytest  # some Blenders that use scans have none

            pytest.skip("this Blender makes no point clouds of meshes")
        bpy.ops.object.convert(target="POINTCLOUD")
        item = bpy.context.object
    fixed = scenes.cube_empty((-0.9, 0, 0), (0.15, 0.4, 0.4), "Fixed")
    moving = scenes.cube_empty((0.9, 0, 0), (0.15, 0.4, 0.4), "Moving")
    bpy.context.view_layer.update()
    scenes.activate(fixed, moving, item)
    bpy.ops.arapfields.add_handle()
    scenes.activate(item)
    return item, moving


def shown(item, values):
    """What the evaluated object has of the attributes of a layout."""
    bpy.context.view_layer.update()
    mesh, result = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data, {}
    for key, column in values(given()).items():
        data = mesh.attributes[key].data
        flat = np.empty(column.size, dtype=np.float32)
        data.foreach_get(kind_of(key, column)[1], flat)
        result[key] = flat.reshape(column.shape)
    return result


def places(item):
    """(n, 3) centers as shown; the object stands at the origin."""
    mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    flat = np.empty(3 * len(given().centers), dtype=np.float32)
    mesh.attributes["position"].data.foreach_get("vector", flat)
    return flat.reshape(-1, 3)
