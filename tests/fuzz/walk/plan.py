# SPDX-License-Identifier: GPL-3.0-or-later
"""Walks as data: scenes and steps by names and seeds; drawn, written, shortened."""

import json
from dataclasses import asdict, dataclass

import numpy as np

# How often each step of a walk is drawn, relative to others. The names are those of methods in steps.py.

SHAPES = {"pin": 6, "drag": 8, "transform": 8, "place_source": 2, "live": 6, "keep": 1, "style": 5}
SHAPES |= {"setting": 3, "delete_pin": 1, "delete": 0.3, "rename": 0.5, "solve": 1.5, "wrap": 0.3, "mode": 1}
TIME = {"undo": 12, "redo": 7, "save": 0.6}

# Of the extension, then of Blender itself.
ALL = {
    "live": 5,
    "solve": 4,
    "operator": 10,
    "setting": 8,
    "entry": 2,
    "handle": 4,
    "move_handle": 5,
    "pin": 2,
}
ALL |= {"bake": 1, "carry": 1, "keep": 1}
ALL |= {"add_modifier": 2, "change_modifier": 3, "duplicate": 1.5, "delete": 1, "join": 0.3, "share": 0.6}
ALL |= {"single_user": 0.4, "hide": 1, "parent": 0.6, "mode": 1, "edit": 1.5, "group": 0.8, "shape_key": 0.8}
ALL |= {"frame": 1.5, "keyframe": 1, "rename": 0.4, "add": 0.5, "link": 0.3, "override": 0.3, "place": 2}
ALL |= {"apply": 0.4, "purge": 0.3, "register": 0.3, "select": 1}


def odds_of(kind):
    return (SHAPES if kind == "SHAPES" else ALL) | TIME


# Walks as data: scenes and steps by names and seeds; drawn, written, shortened.

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
        table = odds_of(kind)
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
