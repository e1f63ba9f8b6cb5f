# SPDX-License-Identifier: GPL-3.0-or-later
"""A worker thread that follows a moving goal: it always works on the newest one and skips those between."""

import threading

from .threads import stand_back

REST = 0.4  # seconds that a goal rests before what was found for it is refined


class Interrupt:
    """Tells a refinement that a newer goal is there; cancels the native calls that it runs."""

    def __init__(self):
        self._lock = threading.Lock()
        self._raised, self._tasks = False, []

    @property
    def raised(self):
        return self._raised

    def watch(self, task):
        """A native task that is cancelled when the interrupt is raised; returns it."""
        with self._lock:
            self._tasks.append(task)
            if self._raised:
                task.cancel()
        return task

    def throw(self):
        with self._lock:
            self._raised = True
            for task in self._tasks:
                task.cancel()


class Follower:
    """`prepare()` runs on the thread first, then `solve(goal)` for the newest goal whenever there is one.

    Where a goal has rested, `refine(goal, interrupt)` yields better and better results until the interrupt is
    raised. `take` hands over the newest result, or what was raised.
    """

    def __init__(self, solve, prepare=None, refine=None, rest=REST, stands_back=False):
        self._solve, self._prepare, self._refine, self._rest = solve, prepare, refine, rest
        self._changed = threading.Condition()
        self._goal = self._result = self._error = self._interrupt = None
        self._working, self._ended, self._refined = prepare is not None, False, True
        self._stands_back = stands_back  # for the window, where there is one
        self._thread = threading.Thread(target=self._run, name="arapfields live", daemon=True)
        self._thread.start()

    def follow(self, goal):
        """Makes this the goal; one that waits is forgotten."""
        with self._changed:
            self._goal = goal
            self._wake()

    def take(self):
        """(result or None, error text) since the last call."""
        with self._changed:
            found = self._result, self._error or ""
            self._result = self._error = None
            return found

    def wait(self, timeout, refined=False):
        """Until the newest goal is reached (and `refined`); False when that takes longer."""

        def reached():
            idle = self._goal is None and not self._working
            return idle and (self._refined or not refined or self._refine is None)

        with self._changed:
            return self._changed.wait_for(reached, timeout)

    @property
    def resting(self):
        """Whether nothing is left to do for the newest goal."""
        with self._changed:
            return self._goal is None and not self._working and (self._refined or self._refine is None)

    def stop(self):
        """Ends the thread and waits for it."""
        with self._changed:
            self._ended = True
            self._wake()
        self._thread.join()

    def _wake(self):
        if self._interrupt is not None:
            self._interrupt.throw()
        self._changed.notify_all()

    def _run(self):
        goal = None
        if self._stands_back:
            stand_back()
        if self._prepare is not None:
            self._attempt(self._prepare)
        while True:
            with self._changed:
                due = self._refine is not None and not self._refined
                self._changed.wait_for(
                    lambda: self._goal is not None or self._ended, self._rest if due else None
                )
                if self._ended:
                    return
                if self._goal is not None:
                    goal, self._goal = self._goal, None
                    self._working, self._refined, due = True, False, False
                else:
                    self._working, self._interrupt = True, Interrupt()
            if due:
                self._improve(goal, self._interrupt)
            else:
                self._attempt(lambda goal=goal: self._solve(goal))

    def _improve(self, goal, interrupt):
        def steps():
            for better in self._refine(goal, interrupt):
                if interrupt.raised:
                    break
                with self._changed:
                    self._result = better

        self._attempt(steps)
        with self._changed:
            self._refined, self._interrupt = not interrupt.raised, None
            self._changed.notify_all()

    def _attempt(self, call):
        result = error = None
        try:
            result = call()
        except Exception as caught:
            if type(caught).__name__ != "Cancelled":
                error = str(caught) or type(caught).__name__
        with self._changed:
            if result is not None:
                self._result = result
            self._error, self._working = error or self._error, False
            self._changed.notify_all()
