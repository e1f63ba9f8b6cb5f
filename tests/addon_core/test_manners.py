# SPDX-License-Identifier: GPL-3.0-or-later
"""Workers stand back for the window; drawing leaves it time; slices of work end."""

import os
import sys
import threading

import pytest

from addon.core.runtime.coroutines import advanced, finished
from addon.core.runtime.threads import STEP, Pace, stand_back


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a priority is the whole process's")
def test_a_worker_and_its_threads_stand_back_alone():
    def priority():
        return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    before, seen = priority(), []

    def worker():
        stand_back()
        seen.append(priority())
        child = threading.Thread(target=lambda: seen.append(priority()))
        child.start()
        child.join()

    thread = threading.Thread(target=worker)
    thread.start()
    thread.join()
    assert seen == [min(19, before + STEP)] * 2 and priority() == before


def test_quick_drawing_keeps_its_pace():
    pace = Pace(0.4)
    assert pace.due(0.0)
    pace.begin(0.0)
    pace.spent(0.01)
    assert not pace.due(0.39) and pace.due(0.4)


def test_slow_drawing_leaves_the_window_more_than_half_of_the_time():
    pace, drawn = Pace(0.4), []
    now, cost = 0.0, 0.35
    while now < 60.0:
        if pace.due(now):
            pace.begin(now)
            drawn.append(now)
            now += cost
            pace.spent(cost)
        else:
            now += 0.01
    assert len(drawn) * cost / now <= Pace.SHARE + 0.01
    assert len(drawn) > 50


def test_even_the_slowest_drawing_goes_on():
    pace = Pace(0.4)
    pace.begin(0.0)
    pace.spent(100.0)
    pace.spent(-1.0)
    assert pace.due(Pace.MOST) and not pace.due(Pace.MOST - 0.1)


def test_courses_are_run_whole_or_for_a_moment():
    def course():
        for _ in range(5):
            yield False
        yield True
        return "made"

    assert finished(course(), wait=0.0) == "made"
    running = course()
    assert not advanced(running, 10.0)  # until it waits for a worker
    assert advanced(running, 10.0)
