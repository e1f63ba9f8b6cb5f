# SPDX-License-Identifier: GPL-3.0-or-later
"""The thread behind live mode: newest request wins, refinement at rest, errors handed over, a clean end."""

import threading

from addon.core.runtime.latest_request_worker import LatestRequestWorker

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


def test_the_error_of_what_failed_first_is_told():
    def fail(text):
        raise ValueError(text)

    worker = LatestRequestWorker(lambda request: fail("later"), prepare=lambda: fail("first"))
    worker.request(1)
    assert worker.wait(LIMIT) and worker.poll() == (None, "first")
    worker.stop()
