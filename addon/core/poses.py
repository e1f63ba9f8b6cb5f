# SPDX-License-Identifier: GPL-3.0-or-later
"""Serialization of a field, with samples of the surface that it was solved on, to bytes."""

import base64
import binascii
import io
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .errors import UserError
from .geometry.spaces import inverse, transform
from .runtime import native

KEPT = 4000  # most samples to store
VERSION = 1


@dataclass(frozen=True)
class Pose:
    """A field in solve space, with samples of its shape there; `local_to_solve` is (4, 4)."""

    field: object
    samples: object
    local_to_solve: np.ndarray

    def to_solve(self, points):
        return transform(self.local_to_solve, points)

    def to_local(self, points):
        return transform(inverse(self.local_to_solve), points)


def to_bytes(pose):
    """The pose as the bytes of an .npz file."""
    points, normals = pose.samples.points, pose.samples.normals
    kept = np.arange(0, len(points), max(1, -(-len(points) // KEPT)))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "field"
        pose.field.save(str(path))
        written = next(Path(folder).iterdir()).read_bytes()
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        version=VERSION,
        field=np.frombuffer(written, np.uint8),
        points=points[kept],
        normals=normals[kept],
        local_to_solve=pose.local_to_solve,
    )
    return buffer.getvalue()


def from_bytes(content, name):
    """The pose from a file's bytes; UserError that names the file if they are invalid."""
    af = native.library()
    from arapfields._files import read_arrays

    try:
        file = read_arrays(content)
        if int(file["version"]) != VERSION:
            raise UserError("{name} was written by a newer version", name=name)
        matrix = np.array(file["local_to_solve"], dtype=np.float64).reshape(4, 4)
        points, normals, written = file["points"], file["normals"], file["field"].tobytes()
        if not np.isfinite(matrix).all() or not abs(np.linalg.det(matrix)) > 0:
            raise UserError("{name} holds no pose", name=name)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "field"
            path.write_bytes(written)
            field = af.DeformationField.load(str(path))
        return Pose(field, af.SurfaceSamples(points, normals, field.frame), matrix)
    except (KeyError, ValueError, OSError, TypeError) as error:
        raise UserError("{name} holds no pose", name=name) from error


def to_text(content):
    return base64.b85encode(content).decode("ascii")


def from_text(text, name):
    try:
        return base64.b85decode(text)
    except (ValueError, binascii.Error) as error:
        raise UserError("{name} holds no pose", name=name) from error
