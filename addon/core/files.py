# SPDX-License-Identifier: GPL-3.0-or-later
"""Files: the cache of fits on disk, and checks that exported files are complete."""

import contextlib
import hashlib
import json
import re
import struct
from pathlib import Path

import numpy as np

# Cache of fitted surfaces on disk, keyed by a hash of the mesh and the fit's options.

SUFFIX = ".safetensors"
NAME = re.compile(rf"[0-9a-f]{{32}}{re.escape(SUFFIX)}")  # as path() makes them of fit_key()
LONGEST_HEADER = 1 << 20  # bytes; a fit's has some thousand
IRRELEVANT = {"threads", "device"}  # options that do not affect the result


def fit_key(vertices, triangles, options, version):
    """Key of the fit of these (n, 3) vertices and (m, 3) triangles with these options (a dict)."""
    digest = hashlib.blake2b(digest_size=16)
    kept = {name: value for name, value in options.items() if name not in IRRELEVANT}
    digest.update(json.dumps([version, sorted(kept.items())]).encode())
    size = np.float32(np.abs(vertices).max(initial=0.0) or 1.0)
    digest.update(size.tobytes())
    digest.update(np.ascontiguousarray(np.round(vertices / size, 7), dtype=np.float32).tobytes())
    digest.update(np.ascontiguousarray(triangles, dtype=np.int32).tobytes())
    return digest.hexdigest()


def is_fit(path):
    """Whether name and header are those of a fit: the folder may hold other files."""
    if not NAME.fullmatch(path.name) or not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            length = int.from_bytes(file.read(8), "little")
            header = json.loads(file.read(length)) if length <= LONGEST_HEADER else {}
        metadata = header["__metadata__"]
        return metadata["format"] == "arapfields" and metadata["kind"] == "sdf"
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return False


class FitCache:
    """A folder of fits; file names are keys."""

    def __init__(self, folder):
        self.folder = Path(folder)

    def path(self, key):
        return self.folder / f"{key}{SUFFIX}"

    def load(self, key, read):
        """The fit of that key by `read(path)`, or None; a file that cannot be read is removed."""
        path = self.path(key)
        if not path.exists():
            return None
        try:
            return read(str(path))
        except ValueError:  # it is damaged; the next fit takes its place
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)
        except OSError:  # it may be read another time
            pass
        return None

    def save(self, key, write):
        """Stores a fit by `write(path)`."""
        self.folder.mkdir(parents=True, exist_ok=True)
        write(str(self.path(key)))

    def files(self):
        return sorted(filter(is_fit, self.folder.iterdir())) if self.folder.is_dir() else []

    def size(self):
        """Bytes on disk."""
        return sum(path.stat().st_size for path in self.files())

    def clear(self):
        """Removes every fit, and no other file; returns how many there were."""
        files = self.files()
        for path in files:
            path.unlink(missing_ok=True)
        return len(files)


# Checks that exported files are complete: Blender's exporters report no full disk.

# Checks that an exported file is complete, as Blender's exporters do not report a full disk. Without bpy.


def is_whole_animation(path, kind):
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


# Checks that exported mesh files are complete: Blender's exporters report no full disk. Without bpy.

STL_HEADER, STL_TRIANGLE = 84, 50  # bytes
PLY_SIZES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}


def are_whole_meshes(path, meshes):
    """Whether the file contains all of these meshes, (vertices, polygons, loops) each."""
    polygons = sum(len(mesh.polygons) for mesh in meshes)
    corners = sum(len(mesh.loops) for mesh in meshes)
    try:
        if path.suffix.lower() == ".stl":
            return _stl(path, corners - 2 * polygons)
        if path.suffix.lower() == ".ply":
            return _ply(path, polygons, corners)
        return _obj(path, sum(len(mesh.vertices) for mesh in meshes), polygons)
    except (ValueError, KeyError, IndexError, struct.error):
        return False


def _stl(path, triangles):
    with path.open("rb") as file:
        (count,) = struct.unpack("<I", file.read(STL_HEADER)[80:])
    return count == triangles and path.stat().st_size == STL_HEADER + STL_TRIANGLE * count


def _ply(path, polygons, corners):
    """Little-endian PLY of Blender: vertices and edges have a fixed size, faces are lists."""
    size, counts, lists = 0, {}, {}
    with path.open("rb") as file:
        for line in iter(file.readline, b""):
            words = line.decode("latin-1").split()
            if words[:1] == ["element"]:
                element, counts[words[1]] = words[1], int(words[2])
            elif words[:2] == ["property", "list"]:
                lists[element] = PLY_SIZES[words[2]], PLY_SIZES[words[3]]
            elif words[:1] == ["property"]:
                size += counts[element] * PLY_SIZES[words[1]]
            elif words == ["end_header"]:
                break
        size += file.tell()
    if polygons:
        length, item = lists["face"]
        size += polygons * length + corners * item
    return counts.get("face", 0) == polygons and path.stat().st_size == size


def _obj(path, vertices, polygons):
    counts = {b"v": 0, b"f": 0}
    used, last = set(), b""
    with path.open("rb") as file:
        for last in file:
            word, _, rest = last.partition(b" ")
            if word in counts:
                counts[word] += 1
            elif word == b"usemtl":
                used.add(rest.strip())
    materials = path.with_suffix(".mtl")
    if materials.exists():
        text = materials.read_bytes()
        defined = {line[7:].strip() for line in text.splitlines() if line.startswith(b"newmtl ")}
        if not text.endswith(b"\n") or not used <= defined:
            return False
    return last.endswith(b"\n") and counts == {b"v": vertices, b"f": polygons}
