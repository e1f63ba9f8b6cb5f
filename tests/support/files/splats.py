# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian splats of tests: a scan, and readers of glTF and USD by their specifications."""

import json
import struct

import numpy as np

import arapfields as af

from ..geometry.meshes import sphere

# Reads splats of glTF and USD files by their specifications, in NumPy and by usd-core.

KINDS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
FROM_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def with_z_up(splats):
    """Splats of a glTF file as Blender imports them: all turned, and their own axes exchanged likewise."""
    turned, (w, x, y, z) = splats.transformed(FROM_Y_UP), splats.rotations.T
    rotations = np.column_stack([w, x, -z, y])
    return af.GaussianSplats(
        turned.centers, rotations, splats.scales[:, [0, 2, 1]], splats.opacities, turned.harmonics
    )


def gltf(path):
    """(GaussianSplats of the one primitive of a .glb, name of its node); what the specifications ask of the
    file is asserted."""
    content = path.read_bytes()
    magic, version, length, size, kind = struct.unpack_from("<4sIII4s", content)
    assert (magic, version, length, kind) == (b"glTF", 2, len(content), b"JSON")
    document = json.loads(content[20 : 20 + size])
    binary_size, kind = struct.unpack_from("<I4s", content, 20 + size)
    binary = content[28 + size :]
    assert kind == b"BIN\0" and binary_size == len(binary) == document["buffers"][0]["byteLength"]
    assert document["asset"]["version"] == "2.0" and size % 4 == binary_size % 4 == 0
    assert document["extensionsUsed"] == ["KHR_gaussian_splatting"]
    (node,), (mesh,) = document["nodes"], document["meshes"]
    (primitive,) = mesh["primitives"]
    assert document["scenes"] == [{"nodes": [0]}] and node["mesh"] == 0 and primitive["mode"] == 0
    extension = primitive["extensions"]["KHR_gaussian_splatting"]
    assert extension == {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}

    def column(name):
        accessor = document["accessors"][primitive["attributes"][name]]
        view = document["bufferViews"][accessor["bufferView"]]
        assert accessor["componentType"] == 5126
        width, start = KINDS[accessor["type"]], view["byteOffset"]
        assert view["byteLength"] == 4 * width * accessor["count"]
        values = np.frombuffer(binary[start : start + view["byteLength"]], "<f4").reshape(-1, width)
        if "min" in accessor:
            assert np.array_equal(
                np.float32([accessor["min"], accessor["max"]]), [values.min(0), values.max(0)]
            )
        else:
            assert name != "POSITION"
        return values

    own, attributes = "KHR_gaussian_splatting:", primitive["attributes"]
    names = [f"{own}SH_DEGREE_{d}_COEF_{k}" for d in range(4) for k in range(2 * d + 1)]
    names = [name for name in names if name in attributes]
    assert len(attributes) == 4 + len(names)
    turns = np.roll(column(own + "ROTATION"), 1, axis=1)
    harmonics = np.stack([column(name) for name in names], axis=1)
    opacities = column(own + "OPACITY")[:, 0]
    return af.GaussianSplats(column("POSITION"), turns, column(own + "SCALE"), opacities, harmonics), node[
        "name"
    ]


def usd(path, time=None):
    """(GaussianSplats of a stage's default prim at a time code, the stage)."""
    from pxr import Usd, UsdVol

    stage = Usd.Stage.Open(str(path))
    field = UsdVol.ParticleField3DGaussianSplat(stage.GetDefaultPrim())
    code = Usd.TimeCode.Default() if time is None else time
    centers = np.array(field.GetPositionsAttr().Get(code))
    turns = [(q.GetReal(), *q.GetImaginary()) for q in field.GetOrientationsAttr().Get(code)]
    harmonics = np.array(field.GetRadianceSphericalHarmonicsCoefficientsAttr().Get(code))
    harmonics = harmonics.reshape(len(centers), -1, 3)
    assert harmonics.shape[1] == (field.GetRadianceSphericalHarmonicsDegreeAttr().Get() + 1) ** 2
    scales, opacities = field.GetScalesAttr().Get(code), field.GetOpacitiesAttr().Get(code)
    low, high = np.array(field.GetExtentAttr().Get(code))
    assert (low < centers.min(0)).all() and (high > centers.max(0)).all()
    return af.GaussianSplats(centers, turns, np.array(scales), np.array(opacities), harmonics), stage


# Gaussian splats on an ellipsoid.

SIZE = np.array([0.8, 0.25, 0.2])
MESH = (sphere(1.0, 4)[0] * SIZE, sphere(1.0, 4)[1])


def splats(count=250, harmonics=16, width=0.05, seed=0):
    """Flat splats of various colors on an ellipsoid."""
    rng = np.random.default_rng(seed)
    samples = af.sample_mesh(*MESH, count=count, seed=seed)
    x, y, z = samples.normals.T  # rotations from z to the normals
    turns = np.column_stack([1 + z + 1e-9, -y, x, 0 * x])
    scales = width * np.array([1.0, 0.7, 0.1]) * rng.uniform(0.9, 1.1, (count, 3))
    colours = 0.25 * rng.normal(size=(count, harmonics, 3))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    return af.GaussianSplats(samples.points, turns, scales, rng.uniform(0.3, 0.95, count), colours)
