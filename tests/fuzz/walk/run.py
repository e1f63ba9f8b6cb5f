# SPDX-License-Identifier: GPL-3.0-or-later
"""Walks as data, drawn, written and shortened; and how they are taken in a process of Blender's."""

import json
import os
import queue
import re
import subprocess
import sys
import tempfile
import threading
from dataclasses import asdict, dataclass, field

import numpy as np

from ..run import ENVIRONMENT, ROOT

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


# Takes walks in a process of Blender's, which may crash or hang.

HANG = 300.0  # seconds that a step may take where others need the processors, too


@dataclass
class Outcome:
    """Of a walk: what was done, step by step, and what is broken at the last of them, if anything is."""

    walk: Walk
    broken: str = ""
    said: list = field(default_factory=list)
    taken: int = 0

    @property
    def kind(self):
        """What makes two failures alike: the error without names and numbers, and where it was raised."""
        last = [line for line in self.broken.splitlines() if line.strip()][-1:] or [""]
        places = re.findall(r'File "[^"]*/(addon/[^"]*)", line (\d+)', self.broken)
        return re.sub(r"[\d.]+|'[^']*'|\[[^]]*\]", "", last[0])[:50], places[-1:]


class Blender:
    """The process; started when it is needed, and again after a crash. `python`: which has bpy."""

    def __init__(self, python=sys.executable):
        self.python, self.process = python, None

    def start(self):
        self.crashes = tempfile.TemporaryFile()  # noqa: SIM115 (for the process)
        command = [self.python, "-m", "tests.fuzz.walk.worker"]
        own = {"WALK_CRASHES": str(self.crashes.fileno()), "OMP_NUM_THREADS": "1"}
        environment = os.environ | ENVIRONMENT | own
        self.process = subprocess.Popen(
            command,
            cwd=ROOT,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=[self.crashes.fileno()],
            text=True,
        )
        self.lines = queue.Queue()
        threading.Thread(target=self.listen, args=(self.process, self.lines), daemon=True).start()

    @staticmethod
    def listen(process, lines):
        for line in process.stdout:
            lines.put(line)
        lines.put(None)

    def take(self, walk):
        """The Outcome of a walk."""
        if self.process is None:
            self.start()
        outcome = Outcome(walk)
        self.process.stdin.write(walk.text() + "\n")
        self.process.stdin.flush()
        while True:
            try:
                line = self.lines.get(timeout=HANG)
            except queue.Empty:
                outcome.broken = f"no end after {HANG:.0f} s"
                self.stop()
                return outcome
            if line is None:
                code = self.process.wait()
                self.crashes.seek(0)
                outcome.broken = (
                    f"{self.crashes.read().decode(errors='replace')[:3000]}\nBlender ended by {code}"
                )
                self.process = None
                return outcome
            said = json.loads(line)
            if "step" in said:
                outcome.said.append(f"{walk.steps[said['step']]}: ?")
            elif "taken" in said:
                outcome.said[-1] = said["taken"]
                outcome.taken += said["taken"] is not None
            else:
                outcome.broken = said["end"]
                return outcome

    def stop(self):
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None


def shorten(blender, outcome):
    """The Outcome of the shortest part of a failing walk that fails alike."""

    known = {}

    def fails(walk):
        if walk not in known:
            known[walk] = blender.take(walk)
        return bool(known[walk].broken) and known[walk].kind == outcome.kind

    begun = outcome.walk.part(outcome.walk.steps[: len(outcome.said)])
    if not fails(begun):
        return outcome  # not again from the same beginning
    found = known[shortest(begun, fails)]
    found.walk = found.walk.part(found.walk.steps[: len(found.said)])
    return found


def report(outcome):
    """Text: the scene, the steps that were taken, and what is broken."""
    steps = [f"  {step}: {said}" for step, said in zip(outcome.walk.steps, outcome.said, strict=False)]
    return "\n".join([f"{outcome.walk.kind}, scene {outcome.walk.seed}:", *steps, outcome.broken])
