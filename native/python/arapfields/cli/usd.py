# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes meshes and splats as USD, still or frame by frame, by the package usd-core."""

import contextlib
import errno
from pathlib import Path

import numpy as np

from .._interrupts import uninterrupted
from .._native import InvalidInput

SUFFIXES = (".usd", ".usda", ".usdc")
AXES = ("y", "z")
AT_ONCE = 64_000_000  # bytes of frames held in memory before they are saved
SPLATS = "ParticleField3DGaussianSplat"
DEGREES = {1: 0, 4: 1, 9: 2, 16: 3}  # {number of harmonics: their degree}
CUT_OFF = 3.0  # standard deviations at which renderers cut a Gaussian off


def require_usd():
    try:
        with uninterrupted():
            from pxr import Usd
    except ImportError:
        raise ImportError("USD needs the package usd-core: pip install 'arapfields[usd]'") from None
    return Usd


def require_usd_splats():
    """ImportError unless the installed USD has a type for Gaussian splats."""
    usd = require_usd()
    if usd.SchemaRegistry().FindConcretePrimDefinition(SPLATS) is None:
        version = ".".join(map(str, usd.GetVersion()[1:]))
        raise ImportError(
            f"USD {version} knows no Gaussian splats; 26.3 or later does, or write .ply or .glb"
        )


def write_usd(path, triangles, frames, *, fps, start, up, name="mesh"):
    """Writes a mesh with a time sample for each of `frames`, an iterable of (n, 3), from time code `start`.

    `up` ("y" or "z") is the stage's up axis; positions are not converted. A .usda is held in memory as a
    whole, .usd and .usdc are saved in between. OSError if the file is incomplete.
    """
    file = MeshFile(path, triangles, fps=fps, start=start, up=up, name=name)
    for frame in frames:
        file.add(frame)
    file.finish()


class UsdFile:
    """A stage with one prim that has a time sample a frame, from time code `start` on, in steps of `step`.

    Without a `start` its one frame stands still. A subclass has `put(frame, time code)`, which returns the
    positions that it wrote and the frame's size in bytes.
    """

    def __init__(self, path, kind, positions, *, up, name, fps=None, start=None, step=1):
        require_usd()
        from pxr import Sdf, Tf, Usd, UsdGeom

        self.path, self.start, self.step, self._positions = Path(path), start, step, positions
        self.count, self._kept, self._last = 0, 0, None
        with self._told():
            self.stage = Usd.Stage.CreateNew(str(path))
            if start is not None:
                self.stage.SetFramesPerSecond(fps)
                self.stage.SetTimeCodesPerSecond(fps)
            UsdGeom.SetStageUpAxis(self.stage, {"y": UsdGeom.Tokens.y, "z": UsdGeom.Tokens.z}[up])
            place = Sdf.Path(f"/{Tf.MakeValidIdentifier(name)}")
            self.stage.SetDefaultPrim(self.stage.DefinePrim(place, kind))

    def add(self, frame):
        from pxr import Usd

        still = Usd.TimeCode.Default()
        with self._told():
            self._last, size = self.put(frame, still if self.start is None else self._time(self.count))
            self.count, self._kept = self.count + 1, self._kept + size
            if self._kept > AT_ONCE and self.path.suffix.lower() != ".usda":
                self.stage.GetRootLayer().Save()
                self._kept = 0

    def finish(self):
        """Saves the file, and reads it anew; OSError if it is incomplete."""
        if not self.count:
            raise InvalidInput("no frame to write")
        with self._told():
            if self.start is not None:
                self.stage.SetStartTimeCode(self.start)
                self.stage.SetEndTimeCode(self._time(self.count - 1))
            self.stage.GetRootLayer().Save()
            self._look()

    def _time(self, index):
        return self.start + index * self.step

    def _look(self):
        from pxr import Sdf, Usd

        stage = Usd.Stage.Open(Sdf.Layer.OpenAsAnonymous(str(self.path)))
        found, still = stage.GetDefaultPrim().GetAttribute(self._positions), self.start is None
        times = [] if still else [self._time(index) for index in range(self.count)]
        end = found.Get(Usd.TimeCode.Default() if still else times[-1])
        if found.GetTimeSamples() != times or end is None or not np.array_equal(np.array(end), self._last):
            raise OSError(errno.EIO, "not written whole; the disk may be full", str(self.path))

    @contextlib.contextmanager
    def _told(self):
        from pxr import Tf

        try:
            yield
        except Tf.ErrorException as error:
            said = " ".join(str(error).split())[:200] or "it said nothing"
            text = f"USD could not write all of it ({said}); the disk may be full"
            raise OSError(errno.EIO, text, str(self.path)) from error


class MeshFile(UsdFile):
    """Frames are positions (n, 3)."""

    def __init__(self, path, triangles, **settings):
        super().__init__(path, "Mesh", "points", **settings)
        from pxr import UsdGeom, Vt

        self.mesh = UsdGeom.Mesh(self.stage.GetDefaultPrim())
        self.mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        self.mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, np.int32)))
        corners = Vt.IntArray.FromNumpy(np.ravel(triangles).astype(np.int32))
        self.mesh.CreateFaceVertexIndicesAttr(corners)

    def put(self, frame, time):
        from pxr import Vt

        frame = np.ascontiguousarray(frame, np.float32)
        self.mesh.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(frame), time)
        bounds = np.array([frame.min(0), frame.max(0)])
        self.mesh.CreateExtentAttr().Set(Vt.Vec3fArray.FromNumpy(bounds), time)
        return frame, frame.nbytes


class SplatFile(UsdFile):
    """Frames are GaussianSplats."""

    def __init__(self, path, **settings):
        require_usd_splats()
        super().__init__(path, SPLATS, "positions", **settings)
        from pxr import UsdVol

        self.field = UsdVol.ParticleField3DGaussianSplat(self.stage.GetDefaultPrim())

    def put(self, splats, time):
        from pxr import Vt

        field, centers, colours = self.field, splats.centers, splats.harmonics
        reach = CUT_OFF * splats.scales.max(axis=1, keepdims=True)
        bounds = np.array([(centers - reach).min(0), (centers + reach).max(0)], np.float32)
        turns = np.ascontiguousarray(np.roll(splats.rotations, -1, axis=1))  # x, y, z, w
        field.CreateExtentAttr().Set(Vt.Vec3fArray.FromNumpy(bounds), time)
        field.CreatePositionsAttr().Set(Vt.Vec3fArray.FromNumpy(centers), time)
        field.CreateOrientationsAttr().Set(Vt.QuatfArray.FromNumpy(turns), time)
        field.CreateScalesAttr().Set(Vt.Vec3fArray.FromNumpy(splats.scales), time)
        field.CreateOpacitiesAttr().Set(Vt.FloatArray.FromNumpy(splats.opacities), time)
        harmonics = Vt.Vec3fArray.FromNumpy(colours.reshape(-1, 3))
        field.CreateRadianceSphericalHarmonicsCoefficientsAttr().Set(harmonics, time)
        field.CreateRadianceSphericalHarmonicsDegreeAttr().Set(DEGREES[colours.shape[1]])
        return centers, 4 * (11 + colours[0].size) * len(splats)
