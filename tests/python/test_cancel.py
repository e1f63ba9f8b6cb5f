# SPDX-License-Identifier: GPL-3.0-or-later
"""A cancel does not wait for the end of an iteration, however many samples it has."""

import threading
import time

import pytest
from support.geometry import cases

import arapfields as af

AT_ONCE = 0.01  # of the time of a solve of one iteration; what takes long before it took 0.05
A_PART = 0.25  # of the shortest iteration seen; a check follows each of its several hundred pieces


def test_a_cancel_does_not_wait_for_the_iteration():
    samples, handles = cases.bar_samples(40_000), cases.bar_handles(40.0)
    options = af.DeformOptions(field="neural", width=64, batch=len(samples.points), iterations=50, threads=1)
    task, moments, ended = af.Task(), [], []

    def solve():
        with pytest.raises(af.Cancelled):
            af.deform(
                samples, handles, options, callback=lambda _: moments.append(time.perf_counter()), task=task
            )
        ended.append(time.perf_counter())

    thread = threading.Thread(target=solve)
    thread.start()
    while len(moments) < 3:
        time.sleep(0.001)
    iteration = min(moments[1] - moments[0], moments[2] - moments[1])
    time.sleep(0.3 * iteration)
    cancelled = time.perf_counter()
    task.cancel()
    thread.join()
    assert ended[0] - cancelled < A_PART * iteration
    assert len(moments) < options.iterations


def seconds(task, **options):
    """Processor time of a solve of one iteration."""
    samples, handles = cases.bar_samples(20_000), cases.bar_handles(40.0)
    before = time.process_time()
    try:
        af.deform(samples, handles, af.DeformOptions(iterations=1, threads=1, **options), task=task)
    except af.Cancelled:
        assert task.cancelled
    return time.process_time() - before


def test_what_is_cancelled_before_it_begins_ends_at_once():
    task = af.Task()
    task.cancel()
    assert seconds(task) < AT_ONCE * seconds(af.Task())
