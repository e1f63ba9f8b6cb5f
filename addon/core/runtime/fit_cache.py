# SPDX-License-Identifier: GPL-3.0-or-later
"""Cache of fitted surfaces on disk, keyed by a hash of the mesh and the fit's options."""

import contextlib
import hashlib
import json
import re
from pathlib import Path

import numpy as np

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
