# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes shared by several processes. Each solves a part of the frames and stores them beside the cache; the
one that completes them writes the cache. Frames of a killed process stay for the next one."""

import hashlib
import time

import numpy as np

from .caches import CacheFile


class SharedCache(CacheFile):
    """`part` is (i, n), the i-th of n, 1 ≤ i ≤ n; `missing`: number of frames not solved yet."""

    def __init__(self, path, frames, fps, part):
        super().__init__(path, frames, fps)
        self.part, self.missing, self._began = part, 0, time.time()
        self._store, self._points, self._places, self._digested = None, 0, [], (None, b"")

    def open(self, solver):
        from arapfields import __version__
        from arapfields.cli.frames import FrameStore

        setup, region, surface = solver.sampled.setup, solver.sampled.region, solver.sampled.setup.surface
        common = [__version__, setup.kind, surface.exact, surface.fit.options, setup.cells]
        content = repr(common).encode() + surface.vertices.tobytes() + surface.triangles.tobytes()
        content += solver.rest.tobytes() + b"".join(handle_bytes(handle) for handle in setup.handles)
        if region is not None:
            content += region.tobytes()
        self._points = len(solver.rest)
        self._folder.make()
        self._store = FrameStore(self.path, self._points, content)

    def add_request(self, solver, request):
        """Solves a frame if it belongs to this part and is not stored yet."""
        number, parts = self.part
        index = len(self._places)
        place = self._store.place(index, self._key(request))
        self._places.append(place)
        if index % parts == number - 1 and not self._store.has(place):
            self._store.put(place, solver.solve_from_rest(request).points)

    def _key(self, request):
        """Arrays that identify a request."""
        if self._digested[0] is not request.points:
            digest = hashlib.blake2b(request.points.tobytes(), digest_size=16).digest()
            self._digested = request.points, digest
        further = repr([request.style_key, sorted(request.energy.items())]).encode()
        digest = hashlib.blake2b(further + self._digested[1], digest_size=16).digest()
        return [*request.targets, np.frombuffer(digest, np.uint8)]

    def finish(self):
        """Makes the cache once all of its frames are solved."""
        with self._store.alone():
            self.missing = sum(not self._store.has(place) for place in self._places)
            if self.missing and self.path.exists() and self.path.stat().st_mtime > self._began:
                self.missing = 0  # another process has written it meanwhile
            elif not self.missing:
                self.open_for(self._points)
                for place in self._places:
                    self.add(self._store.get(place))
                self._writer.commit()
                self._store.remove(self._places)

    def commit(self):
        """Does nothing: `finish` has committed the cache on the worker."""


def handle_bytes(handle):
    """Bytes that identify a handle at rest."""
    parts = [handle.kind, handle.weight, handle.rest, getattr(handle, "weights", None)]
    return b"".join(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode() for part in parts)
