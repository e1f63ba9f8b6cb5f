# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets a solver up before live mode starts, for the object that a tool names as the next one."""

import numpy as np

from ..blender.evaluation import world_matrix
from ..blender.host import has_window
from ..blender.object_references import settings_of
from ..blender.point_data import points_of
from ..blender.user_preferences import machine_options
from ..core.errors import UserError
from ..core.runtime.threads import start_thread
from ..handles import symmetry
from ..results import placement
from ..solver.frame_solver import FrameSolver
from ..solver.setup import SolverSetup, energy_weights, sampled
from ..surface.source_surface import read_surface

LARGEST = 200_000  # most vertices of a source that is prefetched


class SolverPrefetch:
    """At most one solver, without handles, of the source that was prepared last."""

    def __init__(self):
        self._uid = self._thread = self._solver = None

    def prepare(self, context, source):
        """Sets a solver up for deforming the source in place, on a thread; main thread."""
        settings = settings_of(source)
        if self._uid == source.session_uid or len(points_of(source.data)) > LARGEST:
            return
        if not placement.in_place(settings.output, settings.result):
            return
        self.clear()
        self._uid = source.session_uid
        try:
            space = symmetry.space_for(source, world_matrix(source))
            surface = read_surface(context, source, in_place=True, space=space)
        except UserError:
            return
        setup = SolverSetup("DEFORM", surface, None, energy_weights(settings, "DEFORM"), machine_options())
        if surface.exact:  # otherwise a fit is needed, which may take minutes
            self._thread = start_thread("prefetch", lambda: self._make(setup), has_window())

    def _make(self, setup):
        try:
            self._solver = FrameSolver(sampled(setup), None)
        except (ValueError, UserError):  # the session's own setup reports it
            self._solver = None

    def take(self, setup):
        """Hands over the FrameSolver if its surface and energy fit the setup, whatever its handles and
        masses; else None. On a worker."""
        surface = setup.surface
        needs_own = setup.kind != "DEFORM" or not surface.in_place or surface.solids
        if needs_own or self._uid != surface.reference.uid or self._thread is None:
            return None
        solver = self.clear()
        return solver if solver is not None and is_same(solver.sampled.setup, setup) else None

    def clear(self):
        """Waits for the thread; returns its solver, or None."""
        if self._thread is not None:
            self._thread.join()
        solver = self._solver
        self._uid = self._thread = self._solver = None
        return solver


def is_same(a, b):
    """Whether two setups have the same energy, and surfaces that are the same bit for bit."""
    one, other = a.surface, b.surface
    return (
        a.energy == b.energy
        and one.exact == other.exact
        and all(factors is None for factors in other.stiffness)
        and np.array_equal(one.vertices, other.vertices)
        and np.array_equal(one.triangles, other.triangles)
    )


prefetch = SolverPrefetch()
