# SPDX-License-Identifier: GPL-3.0-or-later
"""The thread behind live mode: newest goal wins, refinement at rest, errors handed over, a clean end."""

import threading

from addon.core.runtime.latest_request import Follower

LIMIT = 20  # seconds after which something hangs


def test_goals_between_are_skipped():
    seen, gate = [], threading.Event()

    def solve(goal):
        seen.append(goal)
        gate.wait(LIMIT)
        return goal

    follower = Follower(solve)
    follower.follow(0)
    while not seen:
        pass
    for goal in range(1, 50):
        follower.follow(goal)
    gate.set()
    assert follower.wait(LIMIT)
    assert seen == [0, 49] and follower.take() == (49, "") and follower.take() == (None, "")
    follower.stop()


def test_a_goal_at_rest_is_refined_and_a_new_one_interrupts():
    begun, last = threading.Event(), []

    def refine(goal, interrupt):
        step = 0
        while not interrupt.raised and (goal != "b" or step < 3):
            begun.set()
            step += 1
            yield f"{goal}{step}"
        last.append(goal)

    follower = Follower(lambda goal: goal, refine=refine, rest=0.01)
    follower.follow("a")
    assert begun.wait(LIMIT)
    follower.follow("b")
    assert follower.wait(LIMIT, refined=True) and follower.resting
    assert last[-1] == "b" and follower.take() == ("b3", "")
    follower.stop()


def test_an_interrupt_cancels_the_tasks_of_a_refinement():
    cancelled, ready = threading.Event(), threading.Event()

    class Task:
        def cancel(self):
            cancelled.set()

    def refine(goal, interrupt):
        interrupt.watch(Task())
        ready.set()
        cancelled.wait(LIMIT)
        yield goal

    follower = Follower(lambda goal: goal, refine=refine, rest=0.01)
    follower.follow(1)
    assert ready.wait(LIMIT)
    follower.stop()
    assert cancelled.is_set()


def test_preparing_comes_first_and_errors_are_handed_over():
    order = []

    def fail(goal):
        order.append("solve")
        raise ValueError("no such pose")

    follower = Follower(fail, prepare=lambda: order.append("prepare"))
    follower.follow(1)
    assert follower.wait(LIMIT) and order == ["prepare", "solve"]
    assert follower.take() == (None, "no such pose")
    follower.stop()
