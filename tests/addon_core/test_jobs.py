# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs: outcomes in order, failures kept apart, progress that never falls, cancel and join."""

import threading
import time

import pytest

from addon.core.errors import UserError
from addon.core.runtime import jobs
from addon.core.runtime.progress import ProgressTracker

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


def test_what_the_worker_published_is_gone_once_it_has_ended():
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


def test_cancel_reaches_the_running_item_and_those_that_wait():
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
