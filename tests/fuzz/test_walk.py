# SPDX-License-Identifier: GPL-3.0-or-later
"""A walk through Blender: no crash, no hang, no error, nothing that leads nowhere.

And the shortening of walks that fail.

The seed is fixed; `make fuzz` takes new ones.
"""

from support.blender.inside import require_bpy

from .walk import plan
from .walk.run import Blender, report

STEPS, SEED = 300, 23


def test_a_walk_keeps_the_rules():
    require_bpy()
    blender = Blender()
    try:
        for walk in plan.draw(SEED, STEPS):
            outcome = blender.take(walk)
            assert not outcome.broken, f"--seeds {SEED} --steps {STEPS}\n{report(outcome)}"
    finally:
        blender.stop()


def test_a_failing_walk_is_shortened_to_what_it_needs():
    walk = plan.draw(3, 100)[0]
    needed = {walk.steps[number] for number in (7, 8, 50, 91)}
    tries = []

    def fails(part):
        tries.append(part)
        return needed <= set(part.steps)

    found = plan.shortest(walk, fails)
    assert found.steps == tuple(step for step in walk.steps if step in needed)
    assert (found.kind, found.seed) == (walk.kind, walk.seed) and len(tries) < 2 * len(walk.steps)


def test_a_seed_draws_the_same_walks_again():
    walks = plan.draw(5, 250)
    assert walks == plan.draw(5, 250) and walks != plan.draw(6, 250)
    assert [len(walk.steps) for walk in walks] == [100, 100, 50]
    assert [plan.Walk.of(walk.text()) for walk in walks] == walks
