# SPDX-License-Identifier: GPL-3.0-or-later
"""Short runs of the fuzzers: the cases raise every error of the readers, and fail in no other way."""

import numpy as np
import pytest

from .api import LEFT_OUT, public_callables
from .calls import calls, splat_calls
from .odd import make_things
from .run import refusals, run_target, unreached

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
    "they rise from 0 to the number of pairs",
    "none may be negative",
}


@pytest.fixture(scope="module")
def findings():
    return {}


@pytest.mark.parametrize("target", COUNTS)
def test_nothing_but_documented_errors(target, findings):
    outcome = findings[target] = run_target(target, seed=3, count=COUNTS[target])
    assert sum(outcome.outcomes.values()) == COUNTS[target]
    assert not outcome.failures, outcome.failures[:3]
    if target != "records":  # these count as damaged instead
        assert outcome.outcomes["refused"] > COUNTS[target] // 10


def test_the_readers_refusals_are_reached(findings):
    assert len(refusals()) > 30
    texts = findings["fields"].texts | findings["sdfs"].texts
    missed = [r for r in unreached(texts) if not ELSEWHERE & set(r[2])]
    assert not missed, missed


def test_every_public_callable_is_called_or_left_out_with_its_reason():
    public = set(public_callables())
    assert {"wrap", "MeshSdf", "Attachment", "ObjectStyle", "LiveDeformer.step"} <= public
    things = make_things()
    called = set(calls(np.random.default_rng(0), things)) | set(splat_calls(things))
    assert not called & set(LEFT_OUT)
    assert public == called | set(LEFT_OUT), public ^ (called | set(LEFT_OUT))
