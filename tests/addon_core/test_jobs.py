# SPDX-License-Identifier: GPL-3.0-or-later
"""Work beside the window: jobs, the worker of live mode, and what keeps the window quick."""

import os
import sys
import threading
import time

import pytest

from addon.core.errors import UserError
from addon.core.runtime import jobs
from addon.core.runtime.jobs import (
    Finished,
    Pause,
    ProgressTracker,
    RedrawThrottle,
    run_to_completion,
    step_for,
)
from addon.core.runtime.threads import (
    NICENESS,
    LatestRequestWorker,
    lower_thread_priority,
    own_threads,
    start_thread,
)

# Jobs: outcomes in order, failures kept apart, progress that never falls, cancel and join.

PATIENCE = 10.0  # seconds after which a job that should have ended counts as hung


class FakeTask:
    """Stands for the native task."""

    def __init__(self):
        self.progress, self.message, self.cancelled = 0.0, "", False

    def watch(self, points):
        pass

    def cancel(self):
        self.cancelled = True


class Cancelled(RuntimeError):
    """As the native library raises it."""


def wait_for_cancel(tracker):
    task = tracker.start("Waiting", 1.0)
    while not task.cancelled:
        time.sleep(0.001)
    raise Cancelled


def run(*works):
    items = [jobs.Item(f"item {number}", work) for number, work in enumerate(works)]
    job = jobs.Job("Test", items, FakeTask)
    job.start()
    assert job.join(PATIENCE)
    return job


def test_a_finished_job_publishes_nothing():
    """The main thread may still wait to apply it, and looks at what is shown."""

    def work(tracker):
        tracker.rest_preview_points = [(0.0, 0.0, 0.0)]
        task = tracker.start("Working", 1.0)
        task.looks, task.watched = 1, tracker.rest_preview_points

    assert run(work).preview_points() == (None, 0, None)


def test_every_item_has_its_outcome_though_one_fails():
    def fail(tracker):
        raise UserError("no faces")

    outcomes = run(lambda s: 1, fail, lambda s: 3).take_outcomes()
    assert [o.value for o in outcomes] == [1, None, 3]
    assert [o.error and str(o.error) for o in outcomes] == [None, "no faces", None]


@pytest.mark.parametrize(
    "error, text",
    [
        (ValueError("bad"), "bad"),
        (OSError("full"), "full"),
        (MemoryError(), "memory"),
        (KeyError("x"), "KeyError"),
    ],
)
def test_errors_become_texts(error, text):
    def work(tracker):
        raise error

    (outcome,) = run(work).take_outcomes()
    assert text in str(outcome.error) and not outcome.cancelled


def test_outcomes_are_handed_over_once():
    job = run(lambda s: 1)
    assert len(job.take_outcomes()) == 1 and job.take_outcomes() == []


def test_cancel_reaches_running_and_waiting_items():
    started = threading.Event()

    def first(tracker):
        started.set()
        wait_for_cancel(tracker)

    items = [jobs.Item("first", first), jobs.Item("second", lambda s: s.start("Work", 1.0))]
    job = jobs.Job("Test", items, FakeTask)
    job.start()
    assert started.wait(PATIENCE)
    job.cancel()
    assert job.join(PATIENCE)
    assert [o.cancelled for o in job.take_outcomes()] == [True, True]


def test_progress_never_falls_and_ends_at_one():
    seen = []
    job = None

    def work(tracker):
        for weight in (0.25, 1.0):
            task = tracker.start("Part", weight)
            for step in range(5):
                task.progress = step / 4
                seen.append(job.fraction)

    job = jobs.Job("Test", [jobs.Item("a", work), jobs.Item("b", work)], FakeTask)
    assert job.fraction == 0.0
    job.start()
    assert job.join(PATIENCE)
    assert seen == sorted(seen) and len(seen) == 20
    assert job.fraction == 1.0


def test_stop_joins_the_running_job_and_clears_it():
    job = jobs.Job("Test", [jobs.Item("a", wait_for_cancel)], FakeTask)
    jobs.begin(job)
    assert jobs.running() is job
    jobs.stop()
    assert job.done and jobs.running() is None


def test_a_job_that_never_started_can_be_stopped():
    job = jobs.Job("Test", [], FakeTask)
    job.cancel()
    assert not job.join(0.0)


@pytest.mark.parametrize(
    "native, shown",
    [
        ("", "Deforming"),
        ("iteration 3 of 300", "Deforming: iteration 3 of 300"),
        ("measuring the result", "Deforming: measuring the result"),
    ],
)
def test_a_message_follows_its_stages_name(native, shown):
    tracker = ProgressTracker(FakeTask)
    tracker.start("Deforming", 1.0).message = native
    assert tracker.message == shown


# The thread behind live mode: newest request wins, refinement at rest, errors handed over, a clean end.

LIMIT = 20  # seconds after which something hangs


def test_requests_between_are_skipped():
    seen, gate = [], threading.Event()

    def solve(request):
        seen.append(request)
        gate.wait(LIMIT)
        yield request

    worker = LatestRequestWorker(solve)
    worker.request(0)
    while not seen:
        pass
    for request in range(1, 50):
        worker.request(request)
    gate.set()
    assert worker.wait(LIMIT)
    assert seen == [0, 49] and worker.poll() == (49, "") and worker.poll() == (None, "")
    worker.stop()


def test_a_request_at_rest_is_refined_and_a_new_one_cancels_that():
    begun, last = threading.Event(), []

    def refine(request, token):
        step = 0
        while not token.cancelled and (request != "b" or step < 3):
            begun.set()
            step += 1
            yield f"{request}{step}"
        last.append(request)

    worker = LatestRequestWorker(lambda request: [request], refine=refine, rest=0.01)
    worker.request("a")
    assert begun.wait(LIMIT)
    worker.request("b")
    assert worker.wait(LIMIT, refined=True) and worker.is_settled
    assert last[-1] == "b" and worker.poll() == ("b3", "")
    worker.stop()


def test_a_token_cancels_the_tasks_of_a_refinement():
    cancelled, ready = threading.Event(), threading.Event()

    class Task:
        def cancel(self):
            cancelled.set()

    def refine(request, token):
        token.watch(Task())
        ready.set()
        cancelled.wait(LIMIT)
        yield request

    worker = LatestRequestWorker(lambda request: [request], refine=refine, rest=0.01)
    worker.request(1)
    assert ready.wait(LIMIT)
    worker.stop()
    assert cancelled.is_set()


def test_preparing_comes_first_and_errors_are_handed_over():
    order = []

    def fail(request):
        order.append("solve")
        raise ValueError("no such pose")

    worker = LatestRequestWorker(fail, prepare=lambda: order.append("prepare"))
    worker.request(1)
    assert worker.wait(LIMIT) and order == ["prepare", "solve"]
    assert worker.poll() == (None, "no such pose")
    worker.stop()


def test_a_newer_request_ends_the_better_results_of_the_one_before():
    seen, first = [], threading.Event()

    def solve(request):
        for step in range(3):
            seen.append((request, step))
            yield request, step
            assert first.wait(LIMIT)

    worker = LatestRequestWorker(solve)
    worker.request("a")
    answer = (None, "")
    while answer[0] is None:
        answer = worker.poll()
    assert answer == (("a", 0), "")
    worker.request("b")
    first.set()
    assert worker.wait(LIMIT) and worker.poll() == (("b", 2), "")
    assert seen[0] == ("a", 0) and len([1 for request, _ in seen if request == "a"]) <= 2
    assert seen[-3:] == [("b", 0), ("b", 1), ("b", 2)]
    worker.stop()


def test_the_first_error_is_reported():
    def fail(text):
        raise ValueError(text)

    worker = LatestRequestWorker(lambda request: fail("later"), prepare=lambda: fail("first"))
    worker.request(1)
    assert worker.wait(LIMIT) and worker.poll() == (None, "first")
    worker.stop()


# What keeps a window quick: workers' priority, throttled drawing, the main thread's work in slices.


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


def test_coroutines_run_to_completion_or_for_a_time_slice():
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
