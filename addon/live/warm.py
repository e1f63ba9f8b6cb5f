# SPDX-License-Identifier: GPL-3.0-or-later
"""A solver that is set up before it is asked for: a tool tells which object its user is about to touch."""

import numpy as np

from ..blender.host import has_window
from ..blender.native_options import options_of
from ..blender.object_references import settings_of
from ..core.errors import UserError
from ..core.runtime import native
from ..core.runtime.progress import ProgressTracker
from ..core.runtime.threads import start_thread
from ..results import placement
from ..surface.source_surface import read_surface
from .setup import energy_weights
from .solving import SAMPLES

LARGEST = 200_000  # vertices of a source that is read without being asked for


class Warm:
    """At most one solver, without handles, of the source that was prepared last."""

    def __init__(self):
        self._uid = self._thread = self._made = None

    def prepare(self, context, source):
        """Sets a solver up for deforming the source in place, on a thread; main thread."""
        settings = settings_of(source)
        if self._uid == source.session_uid or len(source.data.vertices) > LARGEST:
            return
        if not placement.in_place(settings.output, settings.target):
            return
        self.clear()
        self._uid = source.session_uid
        try:
            surface = read_surface(context, source, in_place=True)
        except UserError:
            return
        energy = energy_weights(settings, "DEFORM")
        if surface.exact:  # a fit may take minutes
            self._thread = start_thread("warming", lambda: self._make(surface, energy), has_window())

    def _make(self, surface, energy):
        try:
            af = native.library()
            samples = surface.samples(ProgressTracker(af.Task), SAMPLES, 0, own_triangles=True)
            solver = af.LiveDeformer(samples, (), options_of("live", energy))
            solver.track(surface.vertices)
            self._made = surface, energy, samples, solver
        except (ValueError, UserError):  # the session that asks for it will tell
            self._made = None

    def is_ready(self):
        """Whether a solver is set up."""
        return self._made is not None

    def take(self, surface, energy):
        """(samples, solver) of the same surface and weights, now the caller's; or None. On a worker."""
        thread = self._thread
        if self._uid != surface.reference.uid or thread is None:
            return None
        thread.join()
        made = self._made
        self._uid = self._thread = self._made = None
        if made is None or made[1] != energy or not is_same(made[0], surface):
            return None
        return made[2:]

    def clear(self):
        thread = self._thread
        if thread is not None:
            thread.join()
        self._uid = self._thread = self._made = None


def is_same(a, b):
    """Whether two surfaces are the same bit for bit."""
    pairs = [(a.vertices, b.vertices), (a.triangles, b.triangles)]
    return a.exact == b.exact and all(np.array_equal(one, other) for one, other in pairs)


warm = Warm()
