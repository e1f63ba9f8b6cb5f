# SPDX-License-Identifier: GPL-3.0-or-later
"""Takes walks in a process of Blender's, which may crash or hang."""

import json
import os
import queue
import re
import subprocess
import sys
import tempfile
import threading
from dataclasses import dataclass, field
from pathlib import Path

from .plan import Walk

ROOT = Path(__file__).resolve().parents[3]
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
        environment = os.environ | {"WALK_CRASHES": str(self.crashes.fileno()), "OMP_NUM_THREADS": "1"}
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
    from .plan import shortest

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
