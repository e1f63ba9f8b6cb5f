# SPDX-License-Identifier: GPL-3.0-or-later
"""The main thread's work as coroutines: generators that yield a `Pause` every few milliseconds."""

import time
from dataclasses import dataclass
from enum import Enum
from typing import Any

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
