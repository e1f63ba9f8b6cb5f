# SPDX-License-Identifier: GPL-3.0-or-later
"""Work of the main thread in slices: generators that yield False to go on, True to wait for a worker."""

import time


def finished(course, wait=0.002):
    """Runs a course to its end at once; what it returns."""
    while True:
        try:
            if next(course):
                time.sleep(wait)
        except StopIteration as ended:
            return ended.value


def work(course, seconds):
    """Runs a course for a moment. At its end StopIteration carries what it returns."""
    until = time.monotonic() + seconds
    while not next(course) and time.monotonic() < until:
        pass


def advanced(course, seconds):
    """Runs a course for a moment; whether it has ended."""
    try:
        work(course, seconds)
    except StopIteration:
        return True
    return False
