# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress of an item that makes several native calls."""

import threading


class JobCancelled(Exception):
    """The user cancelled the job."""


class ProgressTracker:
    """Progress of one item that makes several native calls, each with its own native Task."""

    def __init__(self, make_task):
        self._make_task = make_task
        self._lock = threading.Lock()
        self._task = None
        self._name = ""
        self._begun = self._weight = 0.0
        self._cancelled = False
        self.warnings = []  # UserErrors to report although there is a result
        self.rest_preview_points = None  # (n, 3) points whose moved positions native calls publish

    def start(self, name, weight):
        """A Task for the next native call, which takes the share `weight` of the remaining work.

        The last call has weight 1, so that progress ends at 1 even if earlier calls were skipped.
        """
        with self._lock:
            self._begun = min(1.0, self._begun + self._weight)
            self._name, self._weight, self._task = name, weight * (1.0 - self._begun), self._make_task()
            if self.rest_preview_points is not None:
                self._task.watch(self.rest_preview_points)
            if self._cancelled:
                self._task.cancel()
                raise JobCancelled
            return self._task

    def cancel(self):
        with self._lock:
            self._cancelled = True
            if self._task is not None:
                self._task.cancel()

    def preview_points(self):
        """(number of published previews, their points) of the current native call."""
        with self._lock:
            task = self._task
        count = task.looks if task is not None and self.rest_preview_points is not None else 0
        return count, task.watched if count else None

    @property
    def fraction(self):
        with self._lock:
            done = self._task.progress if self._task is not None else 0.0
            return min(1.0, self._begun + self._weight * done)

    @property
    def message(self):
        with self._lock:
            name, detail = self._name, self._task.message if self._task is not None else ""
        return f"{name}: {detail}" if detail else name
