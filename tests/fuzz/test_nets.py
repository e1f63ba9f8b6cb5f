# SPDX-License-Identifier: GPL-3.0-or-later
"""Short runs of the fuzzers: the cases raise every error of the readers, and fail in no other way."""

import functools

import numpy as np
import pytest
from support.blender.inside import require_bpy

from .calls import LEFT_OUT, calls, make_things, public_callables, splat_calls
from .run import refusals, run_target, unreached
from .walk import run
from .walk.run import Blender, report

COUNTS = {
    "fields": 1400,
    "sdfs": 500,
    "meshes": 300,
    "handles": 400,
    "normals": 300,
    "records": 300,
    "api": 350,
}
# A file that shrinks while it is read, a pipe (tests/python/test_files.py), two refusals of the writer, and
# two of checksums (tests/python/test_files.py): the damaged files are of version 1, which has none.
ELSEWHERE = {
    "it is being written to",
    "pipes, devices and sockets cannot be read",
    "a header of",
    "a kind without a file format",
    "files from version 2 on have one",
    "sixteen digits are needed",
    "whole numbers from 0 to",  # what an embedding's nodes see: tests/python/test_parts.py
    "whole numbers from -1 to",  # sides of fine parts: tests/python/test_fine_parts.py
    "no list, or a long one",
    "they rise from 0 to the number of pairs",
    "none may be negative",
}


@functools.cache
def outcome_of(target):
    return run_target(target, seed=3, count=COUNTS[target])


@pytest.mark.parametrize("target", COUNTS)
def test_nothing_but_documented_errors(target):
    outcome = outcome_of(target)
    assert sum(outcome.outcomes.values()) == COUNTS[target]
    assert not outcome.failures, outcome.failures[:3]
    if target != "records":  # these count as damaged instead
        assert outcome.outcomes["refused"] > COUNTS[target] // 10


def test_the_readers_refusals_are_reached():
    assert len(refusals()) > 30
    texts = outcome_of("fields").texts | outcome_of("sdfs").texts
    missed = [r for r in unreached(texts) if not ELSEWHERE & set(r[2])]
    assert not missed, missed


def test_every_public_callable_is_called_or_left_out_with_its_reason():
    public = set(public_callables())
    assert {"wrap", "MeshSdf", "Attachment", "ObjectStyle", "LiveDeformer.step"} <= public
    things = make_things()
    called = set(calls(np.random.default_rng(0), things)) | set(splat_calls(things))
    assert not called & set(LEFT_OUT)
    assert public == called | set(LEFT_OUT), public ^ (called | set(LEFT_OUT))


# A walk through Blender: no crash, no hang, no error, nothing that leads nowhere.
#
# And the shortening of walks that fail.
#
# The seed is fixed; `make fuzz` takes new ones.

STEPS, SEED = 300, 23


def test_a_walk_keeps_the_rules():
    require_bpy()
    blender = Blender()
    try:
        for walk in run.draw(SEED, STEPS):
            outcome = blender.take(walk)
            assert not outcome.broken, f"--seeds {SEED} --steps {STEPS}\n{report(outcome)}"
    finally:
        blender.stop()


def test_a_failing_walk_is_shortened_to_what_it_needs():
    walk = run.draw(3, 100)[0]
    needed = {walk.steps[number] for number in (7, 8, 50, 91)}
    tries = []

    def fails(part):
        tries.append(part)
        return needed <= set(part.steps)

    found = run.shortest(walk, fails)
    assert found.steps == tuple(step for step in walk.steps if step in needed)
    assert (found.kind, found.seed) == (walk.kind, walk.seed) and len(tries) < 2 * len(walk.steps)


def test_a_seed_draws_the_same_walks_again():
    walks = run.draw(5, 250)
    assert walks == run.draw(5, 250) and walks != run.draw(6, 250)
    assert [len(walk.steps) for walk in walks] == [100, 100, 50]
    assert [run.Walk.of(walk.text()) for walk in walks] == walks
