# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes an animated mesh as USD, by the package usd-core."""

import errno
from pathlib import Path

import numpy as np

from .._interrupts import uninterrupted
from .._native import InvalidInput

SUFFIXES = (".usd", ".usda", ".usdc")
AXES = ("y", "z")
AT_ONCE = 64_000_000  # bytes of positions held in memory before they are saved


def require_usd():
    try:
        with uninterrupted():
            from pxr import Usd
    except ImportError:
        raise ImportError("USD needs the package usd-core: pip install 'arapfields[usd]'") from None
    return Usd


def write_usd(path, triangles, frames, *, fps, start, up, name="mesh"):
    """Writes a mesh with a time sample for each of `frames`, an iterable of (n, 3), from time code `start`.

    `up` ("y" or "z") is the stage's up axis; positions are not converted. A .usda is held in memory as a
    whole, .usd and .usdc are saved in between. OSError if the file is incomplete.
    """
    usd = require_usd()
    from pxr import Sdf, Tf, UsdGeom, Vt

    path = Path(path)
    try:
        stage = usd.Stage.CreateNew(str(path))
        stage.SetFramesPerSecond(fps)
        stage.SetTimeCodesPerSecond(fps)
        UsdGeom.SetStageUpAxis(stage, {"y": UsdGeom.Tokens.y, "z": UsdGeom.Tokens.z}[up])
        mesh = UsdGeom.Mesh.Define(stage, Sdf.Path(f"/{Tf.MakeValidIdentifier(name)}"))
        stage.SetDefaultPrim(mesh.GetPrim())
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ravel(triangles).astype(np.int32)))
        points, extent = mesh.CreatePointsAttr(), mesh.CreateExtentAttr()
        count, kept, frame = 0, 0, None
        for frame in frames:
            frame = np.ascontiguousarray(frame, np.float32)
            points.Set(Vt.Vec3fArray.FromNumpy(frame), start + count)
            extent.Set(Vt.Vec3fArray.FromNumpy(np.array([frame.min(0), frame.max(0)])), start + count)
            count, kept = count + 1, kept + frame.nbytes
            if kept > AT_ONCE and path.suffix.lower() != ".usda":
                stage.GetRootLayer().Save()
                kept = 0
        if frame is None:
            raise InvalidInput("no frame to write")
        stage.SetStartTimeCode(start)
        stage.SetEndTimeCode(start + count - 1)
        stage.GetRootLayer().Save()
        del stage, mesh, points, extent
        _look(usd, UsdGeom, path, start, count, frame)
    except Tf.ErrorException as error:
        said = " ".join(str(error).split())[:200] or "it said nothing"
        text = f"USD could not write all of it ({said}); the disk may be full"
        raise OSError(errno.EIO, text, str(path)) from error


def _look(usd, geometry, path, start, count, last):
    """OSError if the file is incomplete."""
    stage = usd.Stage.Open(str(path))
    found = geometry.Mesh(stage.GetDefaultPrim()).GetPointsAttr()
    times = found.GetTimeSamples()
    end = found.Get(start + count - 1)
    if times != list(range(start, start + count)) or end is None or not np.array_equal(np.array(end), last):
        raise OSError(errno.EIO, "not written whole; the disk may be full", str(path))
