# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work on one worker thread: progress, cancel, an outcome for each item."""

import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..errors import UserError
from .progress import JobCancelled, Stages
from .threads import stand_back


@dataclass
class Item:
    """One object's work. `work(stages)` runs on the worker and returns what `apply` needs on the main thread.

    `apply` returns the line to report, or is a generator that yields whenever the window may redraw.
    `preview` shows the points that the worker's stages watch.
    """

    label: str
    work: Callable[[Stages], Any]
    apply: Callable[[Any], Any] | None = None
    preview: Any = None


@dataclass
class Outcome:
    item: Item
    value: Any = None
    error: UserError | None = None
    cancelled: bool = False
    seconds: float = 0.0


class Job:
    """Runs items one after another on a thread; one that fails does not stop the rest."""

    def __init__(self, title, items, make_task, stands_back=False):
        self.title = title
        self.items = list(items)
        self._make_task = make_task
        self._stands_back = stands_back  # for the window, where there is one
        self._lock = threading.Lock()
        self._stages = Stages(make_task)
        self._current = 0
        self._cancelled = False
        self._outcomes = []
        self._taken = 0
        self._outside = None  # (share, message) while the main thread works
        self._begin = time.monotonic()
        self._thread = threading.Thread(target=self._run, name=f"arapfields {title}", daemon=True)

    def start(self, items=None):
        """Starts the worker, on these items where they are known only now."""
        if items is not None:
            self.items = list(items)
        self._outside, self._begin = None, time.monotonic()
        self._thread.start()

    def outside(self, fraction, message):
        """Progress of what the main thread does before the worker starts or after it has ended."""
        if self._cancelled:
            raise JobCancelled
        self._outside = fraction, message

    def sight(self):
        """(the item at work, how often its points were looked at, where they were)."""
        with self._lock:
            item = self.items[self._current] if self._current < len(self.items) else None
            stages = self._stages
        return item, *stages.sight()

    def cancel(self):
        """Asks the worker to stop; `join` waits for it."""
        with self._lock:
            self._cancelled = True
            self._stages.cancel()

    def join(self, timeout=None):
        """Waits for the worker; True when it has ended."""
        if self._thread.ident is not None:
            self._thread.join(timeout)
        return self.done

    @property
    def done(self):
        return self._thread.ident is not None and not self._thread.is_alive()

    @property
    def cancelled(self):
        return self._cancelled

    @property
    def fraction(self):
        if self._outside is not None:
            return self._outside[0]
        with self._lock:
            part = self._stages.fraction if self._current < len(self.items) else 0.0
            return min(1.0, (self._current + part) / max(1, len(self.items)))

    @property
    def message(self):
        if self._outside is not None:
            return self._outside[1]
        with self._lock:
            if self._current >= len(self.items):
                return self.title
            label = self.items[self._current].label
            prefix = f"{self._current + 1}/{len(self.items)} {label}" if len(self.items) > 1 else label
            return f"{prefix} · {self._stages.message}" if self._stages.message else prefix

    @property
    def elapsed(self):
        return time.monotonic() - self._begin

    @property
    def remaining(self):
        """Seconds left by the pace so far; None while there is too little to go by."""
        fraction = self.fraction
        return None if fraction < 0.02 else self.elapsed * (1 - fraction) / fraction

    def take_outcomes(self):
        """The outcomes since the last call, for the main thread to apply."""
        with self._lock:
            new = self._outcomes[self._taken :]
            self._taken = len(self._outcomes)
            return new

    def _run(self):
        if self._stands_back:
            stand_back()
        for index, item in enumerate(self.items):
            with self._lock:
                self._current = index
                self._stages = Stages(self._make_task)
                if self._cancelled:
                    self._stages.cancel()
            outcome = run_item(item, self._stages)
            with self._lock:
                self._outcomes.append(outcome)
        with self._lock:
            self._current = len(self.items)


def run_item(item, stages):
    """Runs one item and turns whatever it raises into an outcome."""
    begin = time.monotonic()
    outcome = Outcome(item)
    try:
        outcome.value = item.work(stages)
    except JobCancelled:
        outcome.cancelled = True
    except UserError as error:
        outcome.error = error
    except (ValueError, OSError) as error:
        outcome.error = UserError("{error}", error=error)
    except MemoryError:
        outcome.error = UserError("not enough memory for these settings")
    except Exception as error:
        if type(error).__name__ == "Cancelled":
            outcome.cancelled = True
        else:
            outcome.error = UserError("{error}", error=f"{type(error).__name__}: {error}")
            traceback.print_exc()
    outcome.seconds = time.monotonic() - begin
    return outcome


# The one job that runs, and what the last ones had to say; the panel shows both.
_running = None
_notes = []


def begin(job, start=True):
    """Makes a job the one that runs; without `start` the main thread prepares it first."""
    global _running
    _notes.clear()
    _running = job
    if start:
        job.start()


def end():
    global _running
    _running = None


def stop():
    """Cancels the running job and waits for its worker; nothing of it is applied."""
    job = _running
    if job is not None:
        job.cancel()
        job.join()
        end()


def running():
    return _running


def progress():
    """(share done, what is being done) of the running job."""
    job = _running
    return (job.fraction, job.message) if job is not None else (0.0, "")


def note(level, text):
    """Keeps a line for the panel: INFO, WARNING or ERROR."""
    _notes.append((level, text))


def notes():
    return list(_notes)
