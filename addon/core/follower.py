# SPDX-License-Identifier: GPL-3.0-or-later
"""A worker thread that follows a moving goal: it always works on the newest one and skips those between."""

import threading


class Follower:
    """`solve(goal)` runs on the thread; `take` hands over its newest result, or what it raised."""

    def __init__(self, solve, name="arapfields live"):
        self._solve = solve
        self._changed = threading.Condition()
        self._goal = self._result = self._error = None
        self._working = self._ended = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def follow(self, goal):
        """Makes this the goal; one that waits is forgotten."""
        with self._changed:
            self._goal = goal
            self._changed.notify_all()

    def take(self):
        """(result or None, error text) since the last call."""
        with self._changed:
            found = self._result, self._error or ""
            self._result = self._error = None
            return found

    def wait(self, timeout):
        """Until the newest goal is reached; False when that takes longer."""
        with self._changed:
            return self._changed.wait_for(lambda: self._goal is None and not self._working, timeout)

    def stop(self):
        """Ends the thread and waits for it."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        self._thread.join()

    def _run(self):
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._goal is not None or self._ended)
                if self._ended:
                    return
                goal, self._goal, self._working = self._goal, None, True
            result = error = None
            try:
                result = self._solve(goal)
            except Exception as caught:
                error = str(caught) or type(caught).__name__
            with self._changed:
                self._result, self._error, self._working = result, error, False
                self._changed.notify_all()
