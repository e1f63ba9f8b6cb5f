# SPDX-License-Identifier: GPL-3.0-or-later
"""What keeps a window quick: workers' priority, throttled drawing, the main thread's work in slices."""

import os
import sys
import threading

import pytest

from addon.core.runtime.coroutines import Finished, Pause, run_to_completion, step_for
from addon.core.runtime.redraw_throttle import RedrawThrottle
from addon.core.runtime.threads import NICENESS, lower_thread_priority, own_threads, start_thread


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a priority is the whole process's")
def test_the_priority_of_a_worker_and_its_threads_alone_is_lowered():
    def priority():
        return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    before, seen = priority(), []

    def worker():
        lower_thread_priority()
        seen.append(priority())
        child = threading.Thread(target=lambda: seen.append(priority()))
        child.start()
        child.join()

    thread = threading.Thread(target=worker)
    thread.start()
    thread.join()
    assert seen == [min(19, before + NICENESS)] * 2 and priority() == before


def test_quick_drawing_keeps_its_interval():
    throttle = RedrawThrottle(0.4)
    assert throttle.is_due(0.0)
    throttle.begin(0.0)
    throttle.add_cost(0.01)
    assert not throttle.is_due(0.39) and throttle.is_due(0.4)


def test_slow_drawing_leaves_the_window_more_than_half_of_the_time():
    throttle, drawn = RedrawThrottle(0.4), []
    now, cost = 0.0, 0.35
    while now < 60.0:
        if throttle.is_due(now):
            throttle.begin(now)
            drawn.append(now)
            now += cost
            throttle.add_cost(cost)
        else:
            now += 0.01
    assert len(drawn) * cost / now <= RedrawThrottle.SHARE + 0.01
    assert len(drawn) > 50


def test_even_the_slowest_drawing_goes_on():
    throttle = RedrawThrottle(0.4)
    throttle.begin(0.0)
    throttle.add_cost(100.0)
    throttle.add_cost(-1.0)
    assert throttle.is_due(RedrawThrottle.LONGEST) and not throttle.is_due(RedrawThrottle.LONGEST - 0.1)


def test_coroutines_are_run_whole_or_for_a_moment():
    def coroutine():
        for _ in range(5):
            yield Pause.REDRAW
        yield Pause.WORKER
        return "result"

    waits = []
    assert run_to_completion(coroutine(), wait=lambda: waits.append(1)) == "result" and waits == [1]
    running = coroutine()
    assert step_for(running, 10.0) is None  # until it waits for a worker
    assert step_for(running, 10.0) == Finished("result")


def test_a_slice_ends_when_its_time_is_over():
    steps = []

    def coroutine():
        while True:
            steps.append(1)
            yield Pause.REDRAW

    assert step_for(coroutine(), 0.0) is None
    assert len(steps) == 1


def test_threads_are_known_while_they_run():
    gate = threading.Event()
    thread = start_thread("test", gate.wait)
    assert thread in own_threads() and thread.daemon
    gate.set()
    thread.join()
    assert thread not in own_threads()
