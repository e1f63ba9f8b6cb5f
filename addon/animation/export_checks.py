# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks that an exported file is complete, as Blender's exporters do not report a full disk. Without bpy."""

import struct


def is_whole(path, kind):
    """Whether the file of that kind (ABC, USD or GLTF) has the header and the length of a complete one."""
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            return {"ABC": _ogawa, "USD": _crate, "GLTF": _binary_gltf}[kind](file, size)
    except (OSError, struct.error):
        return False


def _ogawa(file, size):
    """Alembic's Ogawa container: byte 5 is 0xFF once it was closed, bytes 8 to 15 are the root's offset."""
    magic, closed, _, root = struct.unpack("<5sBHQ", file.read(16))
    return magic == b"Ogawa" and closed == 0xFF and root + 8 <= size


def _crate(file, size):
    """USD's binary form: a table of sections, each within the file."""
    magic, _, table = struct.unpack("<8s8sq", file.read(24))
    if magic != b"PXR-USDC" or not 0 < table <= size - 8:
        return False
    file.seek(table)
    (count,) = struct.unpack("<Q", file.read(8))
    if not 0 < count <= (size - table) // 32:
        return False
    sections = [struct.unpack("<16sqq", file.read(32)) for _ in range(count)]
    return all(start >= 0 and 0 <= length <= size - start for _, start, length in sections)


def _binary_gltf(file, size):
    """A .glb stores its length in the header."""
    magic, version, length = struct.unpack("<4sII", file.read(12))
    return magic == b"glTF" and version == 2 and length == size
