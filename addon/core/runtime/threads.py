# SPDX-License-Identifier: GPL-3.0-or-later
"""Threads, with low priority beside a window, and a worker that solves only the newest request."""

import contextlib
import os
import sys
import threading

# Starting of threads, with low priority beside a window.

NICENESS = 10  # added to the nice value of low-priority threads
PREFIX = "arapfields "  # of the threads' names


def start_thread(name, work, low_priority=False):
    """Starts `work()` on a daemon thread; returns the thread."""

    def run():
        if low_priority:
            lower_thread_priority()
        work()

    thread = threading.Thread(target=run, name=f"{PREFIX}{name}", daemon=True)
    thread.start()
    return thread


def own_threads():
    """The threads of the extension that are running."""
    return [thread for thread in threading.enumerate() if thread.name.startswith(PREFIX)]


def lower_thread_priority():
    """Lowers the priority of the calling thread, and of threads that it starts later, below the window's.

    On Linux only: on other systems the nice value belongs to the whole process.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError):
            thread = threading.get_native_id()
            niceness = min(19, os.getpriority(os.PRIO_PROCESS, thread) + NICENESS)
            os.setpriority(os.PRIO_PROCESS, thread, niceness)


# A worker thread for requests that change faster than they are solved: only the newest one counts.

REST = 0.25  # seconds without a new request after which the result is refined


class CancellationToken:
    """Cancelled by a newer request during a refinement; also cancels the refinement's native tasks."""

    def __init__(self):
        self._lock = threading.Lock()
        self._cancelled, self._tasks = False, []

    @property
    def cancelled(self):
        return self._cancelled

    def watch(self, task):
        """Links a native task to the token: both are cancelled together. Returns the task."""
        with self._lock:
            self._tasks.append(task)
            if self._cancelled:
                task.cancel()
        return task

    def cancel(self):
        with self._lock:
            self._cancelled = True
            for task in self._tasks:
                task.cancel()


class LatestRequestWorker:
    """Runs `prepare()` once, then `solve(request)` for the newest request; skips those in between.

    `solve` yields better and better results; a newer request ends it.
    After `rest` seconds without a new request, or at once after `hurry` or `wait(refined=True)`,
    `refine(request, token)` yields better and better results until the token is cancelled.
    `poll` returns the newest result, or the error.
    """

    def __init__(self, solve, prepare=None, refine=None, rest=REST, low_priority=False):
        self._solve, self._prepare, self._refine, self._rest = solve, prepare, refine, rest
        self._changed = threading.Condition()
        self._request = self._result = self._error = self._token = None
        self._working, self._ended, self._refined = prepare is not None, False, True
        self._answers = False  # whether the newest request has a result
        self._hurried = False  # whether to refine the newest request without a pause
        self._thread = start_thread("live", self._run, low_priority)

    def request(self, request):
        """Makes this the newest request; one that is still waiting is dropped."""
        with self._changed:
            self._request, self._hurried, self._answers = request, False, False
            self._wake()

    def hurry(self):
        """Starts the refinement of the newest request at once."""
        with self._changed:
            self._hurried = True
            self._changed.notify_all()

    def poll(self):
        """(result or None, error text) since the last call."""
        with self._changed:
            newest = self._result, self._error or ""
            self._result = self._error = None
            return newest

    def wait_for_result(self, timeout):
        """Waits until the newest request has a result or nothing is left to do, at most `timeout` seconds."""
        with self._changed:
            self._changed.wait_for(lambda: self._answers or self._error or self._is_idle(), timeout)

    def _is_idle(self):
        return self._request is None and not self._working

    def wait(self, timeout, refined=False):
        """Waits until the newest request is solved (and `refined`); False after `timeout` seconds."""

        def reached():
            return self._is_idle() and (self._refined or not refined or self._refine is None)

        if refined:
            self.hurry()
        with self._changed:
            return self._changed.wait_for(reached, timeout)

    @property
    def is_settled(self):
        """Whether nothing is left to do for the newest request."""
        with self._changed:
            return self._is_idle() and (self._refined or self._refine is None)

    def stop(self):
        """Ends the thread and waits for it."""
        with self._changed:
            self._ended = True
            self._wake()
        self._thread.join()

    def _wake(self):
        if self._token is not None:
            self._token.cancel()
        self._changed.notify_all()

    def _run(self):
        request = None
        if self._prepare is not None:
            self._attempt(self._prepare)
        while True:
            with self._changed:
                due = self._refine is not None and not self._refined
                self._changed.wait_for(
                    lambda due=due: self._request is not None or self._ended or (due and self._hurried),
                    self._rest if due else None,
                )
                if self._ended:
                    return
                if self._request is not None:
                    request, self._request = self._request, None
                    self._working, self._refined, due = True, False, False
                else:
                    self._working, self._token = True, CancellationToken()
            if due:
                self._improve(request, self._token)
            else:
                self._attempt(lambda request=request: self._follow(request))

    def _follow(self, request):
        """Publishes the results of `solve` until a newer request comes."""
        for result in self._solve(request):
            with self._changed:
                self._result, self._answers = result, self._request is None
                self._changed.notify_all()
                if self._request is not None or self._ended:
                    break

    def _improve(self, request, token):
        def steps():
            for better in self._refine(request, token):
                if token.cancelled:
                    break
                with self._changed:
                    self._result = better

        self._attempt(steps)
        with self._changed:
            self._refined, self._token = not token.cancelled, None
            self._changed.notify_all()

    def _attempt(self, call):
        error = None
        try:
            call()
        except Exception as caught:
            if type(caught).__name__ != "Cancelled":
                error = str(caught) or type(caught).__name__
        with self._changed:
            self._error, self._working = self._error or error, False  # the first is the cause
            self._changed.notify_all()
