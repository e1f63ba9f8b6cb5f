# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits how often something is drawn, by what drawing costs."""

import math


class RedrawThrottle:
    """Tells when to draw again, so that drawing takes no more than a share of the window's time."""

    SHARE = 0.4
    LONGEST = 5.0  # seconds between two drawings, however slow they are

    def __init__(self, interval):
        self.interval = interval  # seconds between two drawings, however quick they are
        self._begun, self._busy = -math.inf, 0.0

    def add_cost(self, seconds):
        """The window was late by this much: that is what drawing costs."""
        self._busy += max(0.0, seconds)

    def is_due(self, now):
        return now - self._begun >= min(self.LONGEST, max(self.interval, self._busy / self.SHARE))

    def begin(self, now):
        """A drawing starts now."""
        self._begun, self._busy = now, 0.0
