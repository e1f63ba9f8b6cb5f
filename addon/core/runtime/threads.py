# SPDX-License-Identifier: GPL-3.0-or-later
"""Manners towards the window: workers that stand back for it, drawing that leaves it time for the user."""

import contextlib
import math
import os
import sys
import threading

STEP = 10  # of priority, below the window's


def stand_back():
    """The calling thread, and each that it starts from now on, works with what the window leaves it.

    On Linux alone: elsewhere such a priority belongs to the whole process.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError):
            thread = threading.get_native_id()
            os.setpriority(os.PRIO_PROCESS, thread, min(19, os.getpriority(os.PRIO_PROCESS, thread) + STEP))


class Pace:
    """Says when to draw again, so that drawing keeps the window busy for no more than a share of the time."""

    SHARE = 0.4
    MOST = 5.0  # seconds between two drawings, however slow they are

    def __init__(self, least):
        self.least = least  # seconds between two drawings, however quick they are
        self._begun, self._busy = -math.inf, 0.0

    def spent(self, seconds):
        """The window was late by so much: that is what drawing costs."""
        self._busy += max(0.0, seconds)

    def due(self, now):
        return now - self._begun >= min(self.MOST, max(self.least, self._busy / self.SHARE))

    def begin(self, now):
        """Something is drawn now."""
        self._begun, self._busy = now, 0.0
