# SPDX-License-Identifier: GPL-3.0-or-later
"""Secondary motion in a live session's solver: steps of an animation, and swings in real time."""

import time

import numpy as np

from ..blender import vertex_groups
from ..blender.native_options import options_of

PACE = 1 / 60  # seconds from one shape to the next while it swings
MOST_PACES = 3  # that a step in real time stands for; fewer lengths of steps, fewer preconditioners
STILL, STILL_STEPS = 1e-3, 20  # of the size a second, so many steps in turn: it has come to rest


class Swinging:
    """Mixin of a session: all of this runs on its worker, or on another thread than the main one."""

    masses = None  # (n,) of vertices, then of samples; None: the same everywhere
    clock = None  # when the last step in real time ended; None: what comes next begins at rest
    stepped = None  # the Body of that step

    def place_masses(self):
        if self.masses is not None:
            points = self.surface.vertices, self.masses, self.samples.points
            self.masses = vertex_groups.at_points(*points)

    def set_body(self, body):
        """Has the solver know what it moves as a body; None: as a shape alone."""
        self.body = body
        if body is None:
            self.solver.set_secondary_motion(None)
            return
        options = options_of("secondary", dict(body.options))
        further = {"masses": self.masses, "up": body.up, "ground": body.ground}
        self.solver.set_secondary_motion(options, **further)

    def step_from(self, moment, request, seconds, task=None):
        """The shape that a request leads to from a Moment (simulation.py) so many seconds earlier."""
        targets = self.aim(request)
        self.solver.motion_state = moment.state
        coordinates = request.body.coordinates_since(moment.body)
        self.solver.step(targets, seconds, coordinates=coordinates, task=task)
        return self.shape(self.solver.field(self.rest))

    def swing(self, request):
        """Steps to the request in as many seconds as have passed since the last one."""
        now, clock = time.monotonic(), self.clock
        targets = self.aim(request)
        if clock is None:
            self.solver.solve(targets)
        else:
            seconds = PACE * int(np.clip(round((now - clock) / PACE), 1, MOST_PACES))
            coordinates = request.body.coordinates_since(self.stepped)
            self.solver.step(targets, seconds, coordinates=coordinates)
        self.clock, self.stepped = now, request.body

    def settle(self, request, token):
        """Shapes in real time until it has come to rest."""
        still, size = 0, np.ptp(self.samples.points, axis=0).max()
        while still < STILL_STEPS and not token.cancelled:
            begun = time.monotonic()
            self.swing(request)
            still = still + 1 if self.solver.report.speed < STILL * size else 0
            yield self.shape(self.solver.tracked())
            time.sleep(max(0.0, begun + PACE - time.monotonic()))
