# SPDX-License-Identifier: GPL-3.0-or-later
"""Walks as data: scenes and steps by names and seeds; drawn, written, shortened."""

import json
from dataclasses import asdict, dataclass

import numpy as np

from . import tables

LENGTH = 100  # steps of one scene


@dataclass(frozen=True)
class Walk:
    """`kind`: SHAPES, whose shapes are compared with fresh solves, or ALL, of every operator and property."""

    kind: str
    seed: int  # of the scene
    steps: tuple  # of (name, seed)

    def text(self):
        return json.dumps(asdict(self))

    @classmethod
    def of(cls, text):
        given = json.loads(text)
        return cls(given["kind"], given["seed"], tuple(map(tuple, given["steps"])))

    def part(self, steps):
        return Walk(self.kind, self.seed, tuple(steps))


def draw(seed, count):
    """Walks of `count` steps together, one in four of shapes."""
    walks, number = [], 0
    while count > 0:
        rng = np.random.default_rng([seed, number])
        kind = "SHAPES" if rng.random() < 0.25 else "ALL"
        table = tables.of(kind)
        odds = np.array(list(table.values()))
        length = min(LENGTH, count)
        names = rng.choice(list(table), size=length, p=odds / odds.sum())
        seeds = rng.integers(1 << 30, size=length)
        steps = tuple((str(name), int(one)) for name, one in zip(names, seeds, strict=True))
        walks.append(Walk(kind, int(rng.integers(1 << 30)), steps))
        count, number = count - length, number + 1
    return walks


def shortest(walk, fails):
    """A part of a failing walk that `fails(walk)` as well, and of which no single step can be left out."""
    steps, size = list(walk.steps), max(1, len(walk.steps) // 2)
    while size:
        begin = len(steps) - size
        while begin > -size:
            rest = steps[: max(begin, 0)] + steps[begin + size :]
            if len(rest) < len(steps) and fails(walk.part(rest)):
                steps = rest
            begin -= size
        size //= 2
    return walk.part(steps)
