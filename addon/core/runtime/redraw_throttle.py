# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits the frequency of redraws by their cost."""

import math


class RedrawThrottle:
    """Decides when to redraw, so that drawing takes a limited share of the window's time."""

    SHARE = 0.4
    LONGEST = 5.0  # most seconds between redraws

    def __init__(self, interval):
        self.interval = interval  # least seconds between redraws
        self._begun, self._busy = -math.inf, 0.0

    def add_cost(self, seconds):
        """Adds seconds by which an event of the window was late, as a measure of the drawing cost."""
        self._busy += max(0.0, seconds)

    def is_due(self, now):
        return now - self._begun >= min(self.LONGEST, max(self.interval, self._busy / self.SHARE))

    def begin(self, now):
        """Called when a redraw starts."""
        self._begun, self._busy = now, 0.0
