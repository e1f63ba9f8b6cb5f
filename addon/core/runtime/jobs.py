# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs: long work on a worker thread, the main thread's part as coroutines, progress, redraws, outcomes."""

import math
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple

from ..errors import UserError, as_user_error
from .threads import start_thread

# The main thread's work as coroutines: generators that yield a `Pause` every few milliseconds.

SLICE = 0.02  # seconds of work on the main thread between redraws


class Pause(Enum):
    """Why a coroutine yields."""

    REDRAW = "the window may redraw; there is more to do"
    WORKER = "nothing to do until a worker thread is done"


@dataclass(frozen=True)
class Finished:
    """The result of a coroutine that has ended."""

    value: Any


def step_for(coroutine, seconds=SLICE):
    """Runs a coroutine until it waits for a worker or time is up; returns Finished at its end, else None."""
    until = time.monotonic() + seconds
    try:
        while next(coroutine) is Pause.REDRAW and time.monotonic() < until:
            pass
    except StopIteration as ended:
        return Finished(ended.value)
    return None


def run_to_completion(coroutine, wait=lambda: time.sleep(0.002)):
    """Runs a coroutine to its end and returns its result; calls `wait()` while it waits for a worker."""
    while True:
        try:
            if next(coroutine) is Pause.WORKER:
                wait()
        except StopIteration as ended:
            return ended.value


# Limits the frequency of redraws by their cost.


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


# Progress of an item that makes several native calls.


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


# Jobs: long work on a worker thread, with progress, cancellation, and an outcome per item.


@dataclass
class Item:
    """One object's work: `work(tracker)` runs on the worker, `apply` receives its value on the main thread.


    `apply` returns the line to report, or is a coroutine (runtime/jobs.py) that does.
    `preview`, if any, has `show(points)` and `clear()`, and displays the tracker's preview points.
    `edits`: references to the objects whose mesh `apply` writes.
    """

    label: str
    work: Callable[[ProgressTracker], Any]
    apply: Callable[[Any], Any] | None = None
    preview: Any = None
    edits: tuple = ()


@dataclass
class Outcome:
    item: Item
    value: Any = None
    error: UserError | None = None
    cancelled: bool = False
    seconds: float = 0.0
    warnings: list = field(default_factory=list)


class Job:
    """Runs items one after another on a thread; one that fails does not stop the rest."""

    def __init__(self, title, items, make_task, low_priority=False):
        self.title = title
        self.items = list(items)
        self._make_task = make_task
        self._low_priority = low_priority
        self._lock = threading.Lock()
        self._tracker = ProgressTracker(make_task)
        self._current = 0
        self._cancelled = False
        self._outcomes = []
        self._taken = 0
        self._main_thread = None  # (fraction, message) while the main thread works
        self.waiting = ""  # what the main thread waits for
        self._begin = time.monotonic()
        self._thread = None

    def start(self, items=None):
        """Starts the worker, with these items if they were not known before."""
        if items is not None:
            self.items = list(items)
        self._main_thread, self._begin = None, time.monotonic()
        self._thread = start_thread(self.title, self._run, self._low_priority)

    def report_main_thread(self, fraction, message):
        """Sets the progress of work on the main thread, before the worker starts or after it has ended."""
        if self._cancelled:
            raise JobCancelled
        self._main_thread = fraction, message

    def preview_points(self):
        """(current item, number of published previews, their points), or (None, 0, None)."""
        with self._lock:
            if self._current >= len(self.items):
                return None, 0, None
            item, tracker = self.items[self._current], self._tracker
        return item, *tracker.preview_points()

    def cancel(self):
        """Asks the worker to stop; `join` waits for it."""
        with self._lock:
            self._cancelled = True
            self._tracker.cancel()

    def join(self, timeout=None):
        """Waits for the worker; True when it has ended."""
        if self._thread is not None:
            self._thread.join(timeout)
        return self.done

    @property
    def done(self):
        return self._thread is not None and not self._thread.is_alive()

    @property
    def cancelled(self):
        return self._cancelled

    @property
    def fraction(self):
        if self._main_thread is not None:
            return self._main_thread[0]
        with self._lock:
            part = self._tracker.fraction if self._current < len(self.items) else 0.0
            return min(1.0, (self._current + part) / max(1, len(self.items)))

    @property
    def message(self):
        if self.waiting:
            return self.waiting
        if self._main_thread is not None:
            return self._main_thread[1]
        with self._lock:
            if self._current >= len(self.items):
                return self.title
            label = self.items[self._current].label
            prefix = f"{self._current + 1}/{len(self.items)} {label}" if len(self.items) > 1 else label
            return f"{prefix} · {self._tracker.message}" if self._tracker.message else prefix

    @property
    def elapsed(self):
        return time.monotonic() - self._begin

    @property
    def remaining(self):
        """Estimated seconds left, by the progress so far; None below 2 %."""
        fraction = self.fraction
        return None if fraction < 0.02 else self.elapsed * (1 - fraction) / fraction

    def take_outcomes(self):
        """The outcomes since the last call, for the main thread to apply."""
        with self._lock:
            new = self._outcomes[self._taken :]
            self._taken = len(self._outcomes)
            return new

    def _run(self):
        for index, item in enumerate(self.items):
            with self._lock:
                self._current = index
                self._tracker = ProgressTracker(self._make_task)
                if self._cancelled:
                    self._tracker.cancel()
            outcome = run_item(item, self._tracker)
            with self._lock:
                self._outcomes.append(outcome)
        with self._lock:
            self._current = len(self.items)


def run_item(item, tracker):
    """Runs one item and turns whatever it raises into an outcome."""
    begin = time.monotonic()
    outcome = Outcome(item, warnings=tracker.warnings)
    try:
        outcome.value = item.work(tracker)
    except JobCancelled:
        outcome.cancelled = True
    except (UserError, ValueError, OSError) as error:
        outcome.error = as_user_error(error)
    except MemoryError:
        outcome.error = UserError("Not enough memory for these settings")
    except Exception as error:
        if type(error).__name__ == "Cancelled":
            outcome.cancelled = True
        else:
            outcome.error = UserError("{error}", error=f"{type(error).__name__}: {error}")
            traceback.print_exc()
    outcome.seconds = time.monotonic() - begin
    return outcome


class Message(NamedTuple):
    """A line for the panel. `about`: session_uids of the objects that it concerns; none for no one object."""

    level: str  # INFO, WARNING or ERROR
    text: str
    about: frozenset = frozenset()


class Board:
    """The running job, if any, and the messages of the last one; the panel shows both."""

    def __init__(self):
        self.job, self.messages = None, []

    def clear(self):
        """Cancels the running job and waits for its worker; applies no outcomes."""
        if self.job is not None:
            self.job.cancel()
            self.job.join()
            self.job = None


board = Board()


def begin(job, start=True):
    """Makes a job the running one; without `start`, the main thread prepares it first."""
    board.messages.clear()
    board.job = job
    if start:
        job.start()


def stop():
    board.clear()


def running():
    return board.job


def progress():
    """(fraction done, message) of the running job."""
    job = board.job
    return (job.fraction, job.message) if job is not None else (0.0, "")


def add_message(level, text, about=()):
    """Adds a Message."""
    board.messages.append(Message(level, text, frozenset(about)))


def forget_messages():
    board.messages.clear()


def messages():
    """[(level, text)], whatever they are about."""
    return [(message.level, message.text) for message in board.messages]
