# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes that several processes share: each solves a part of the frames, kept beside the cache, and whoever
comes when all are there makes the cache. A killed process's frames stay, so the next one goes on."""

import hashlib

import numpy as np

from ..live.session import Session


class SharedFrames:
    """The frames of one object's bake: `part` is (i, n), the i-th of n, 1 ≤ i ≤ n."""

    def __init__(self, path, session, points, part):
        from arapfields import __version__
        from arapfields.cli.frames import FrameStore

        self.part, self.places, self._last = part, [], (None, b"")
        surface = session.surface
        common = [
            __version__,
            session.kind,
            session.output,
            surface.exact,
            surface.fit.options,
            session.cells,
        ]
        content = repr(common).encode() + surface.vertices.tobytes() + surface.triangles.tobytes()
        content += session.rest.tobytes() + b"".join(held(handle) for handle in session.handles)
        if session.weights is not None:
            content += session.weights.tobytes()
        self._store = FrameStore(path, points, content)

    def add(self, session: Session, request):
        """Solves a frame where it is this part's and nobody has it yet."""
        number, parts = self.part
        index = len(self.places)
        place = self._store.place(index, self._key(request))
        self.places.append(place)
        if index % parts == number - 1 and not self._store.has(place):
            self._store.put(place, session.solve_from_rest(request).points)

    def _key(self, request):
        """Arrays that tell this request from others."""
        if self._last[0] is not request.points:
            self._last = request.points, hashlib.blake2b(request.points.tobytes(), digest_size=16).digest()
        further = repr([request.style and request.style[0], sorted(request.energy.items())]).encode()
        digest = hashlib.blake2b(further + self._last[1], digest_size=16).digest()
        return [*request.targets, np.frombuffer(digest, np.uint8)]

    def alone(self):
        return self._store.alone()

    def missing(self):
        """How many frames are still to be solved, by others."""
        return sum(not self._store.has(place) for place in self.places)

    def __iter__(self):
        return (self._store.get(place) for place in self.places)

    def remove(self):
        """They are in the cache now."""
        self._store.remove(self.places)


def held(handle):
    """Bytes that stand for a handle at rest."""
    parts = [handle.kind, handle.weight, handle.rest, getattr(handle, "weights", None)]
    return b"".join(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode() for part in parts)
