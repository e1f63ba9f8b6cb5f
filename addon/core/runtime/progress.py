# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress of one piece of work through several native calls."""

import threading


class JobCancelled(Exception):
    """The user cancelled the job."""


class Stages:
    """Progress of one item through several native calls, each with a task of its own."""

    def __init__(self, make_task):
        self._make_task = make_task
        self._lock = threading.Lock()
        self._task = None
        self._name = ""
        self._begun = self._share = 0.0
        self._cancelled = False
        self.watched_points = None  # (n, 3) that every native call shall tell the present places of

    def start(self, name, share):
        """A task for the next native call, which is about `share` of the item's work."""
        with self._lock:
            self._begun = min(1.0, self._begun + self._share)
            self._name, self._share, self._task = name, share, self._make_task()
            if self.watched_points is not None:
                self._task.watch(self.watched_points)
            if self._cancelled:
                self._task.cancel()
                raise JobCancelled
            return self._task

    def cancel(self):
        with self._lock:
            self._cancelled = True
            if self._task is not None:
                self._task.cancel()

    def sight(self):
        """(how often the watched points were looked at, where they were) in the present native call."""
        with self._lock:
            task = self._task
        looks = task.looks if task is not None and self.watched_points is not None else 0
        return looks, task.watched if looks else None

    @property
    def fraction(self):
        with self._lock:
            done = self._task.progress if self._task is not None else 0.0
            return min(1.0, self._begun + self._share * done)

    @property
    def message(self):
        with self._lock:
            name, detail = self._name, self._task.message if self._task is not None else ""
        verb, colon, rest = detail.partition(": ")  # "deform: iteration 3 of 300": the name has said the verb
        if colon and " " not in verb:
            detail = rest
        return f"{name}: {detail}" if detail else name
