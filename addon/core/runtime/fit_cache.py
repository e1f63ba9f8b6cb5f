# SPDX-License-Identifier: GPL-3.0-or-later
"""Cache of fitted surfaces on disk, keyed by a hash of the mesh and the fit's options."""

import hashlib
import json
from pathlib import Path

import numpy as np

SUFFIX = ".safetensors"
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
        except (ValueError, OSError):
            path.unlink(missing_ok=True)
            return None

    def save(self, key, write):
        """Stores a fit by `write(path)`."""
        self.folder.mkdir(parents=True, exist_ok=True)
        write(str(self.path(key)))

    def files(self):
        return sorted(self.folder.glob(f"*{SUFFIX}")) if self.folder.is_dir() else []

    def size(self):
        """Bytes on disk."""
        return sum(path.stat().st_size for path in self.files())

    def clear(self):
        """Removes every fit; returns how many there were."""
        files = self.files()
        for path in files:
            path.unlink(missing_ok=True)
        return len(files)
