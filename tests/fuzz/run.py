# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs fuzz targets in separate processes; a new process continues after a case that ended one."""

import json
import os
import queue
import re
import subprocess
import sys
import threading
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HANG = 60.0  # seconds without output
AT_ONCE = 2000  # cases per process
ENVIRONMENT = {"MALLOC_PERTURB_": "165"}  # glibc overwrites freed memory, so that later reads of it fail


@dataclass
class Findings:
    """The outcomes of a target's cases."""

    target: str
    outcomes: Counter = field(default_factory=Counter)
    failures: list = field(default_factory=list)  # [(number, text)]
    texts: set = field(default_factory=set)  # messages of all documented errors

    def add(self, number, outcome):
        self.outcomes[outcome["outcome"]] += 1
        if outcome["outcome"] == "refused":
            self.texts.add(outcome["text"])
        if outcome["outcome"] == "failed":
            self.failures.append((number, outcome["text"]))


def run_target(target, seed, count):
    """Findings of cases 0 to `count`."""
    findings, first = Findings(target), 0
    while first < count:
        first = _run_process(findings, seed, first, min(AT_ONCE, count - first))
    return findings


def _run_process(findings, seed, first, count):
    """Runs cases in one process; returns the number of the next case."""
    command = [sys.executable, "-m", "tests.fuzz.worker", findings.target, str(seed), str(first), str(count)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, cwd=ROOT, env=os.environ | ENVIRONMENT, **pipes)
    lines, errors = queue.Queue(), []
    readers = [
        threading.Thread(target=lambda: [lines.put(line) for line in process.stdout] + [lines.put(None)]),
        threading.Thread(target=lambda: errors.extend(process.stderr)),
    ]
    for reader in readers:
        reader.start()
    number, done = None, first
    try:
        while (line := lines.get(timeout=HANG)) is not None:
            said = json.loads(line)
            if isinstance(said, int):
                number = said
            else:
                findings.add(done, said)
                done += 1
    except queue.Empty:
        findings.add(done, {"outcome": "failed", "text": f"no sign of life for {HANG:g} s"})
        done += 1
        process.kill()
    finally:
        code = process.wait(HANG)
        for reader in readers:
            reader.join()
    if done < first + count and (code not in (0, -9) or done == first):
        if number is None:
            raise RuntimeError("".join(errors)[-3000:])
        findings.add(done, {"outcome": "failed", "text": f"ended by {code}: {''.join(errors)[-1500:]}"})
        done += 1
    return done


def refusals(folder="native/io", names=("document", "field_file", "input_file")):
    """(file, line, fixed parts of the text) of each error in the readers' source."""
    refused = []
    for name in names:
        text = (ROOT / folder / f"{name}.cpp").read_text()
        for call in re.finditer(r"\b(?:require|throw InvalidInput)\((?:[^;\"]|\"(?:\\.|[^\"\\])*\")*;", text):
            parts = re.findall(r'"((?:\\.|[^"\\])*)"', call[0])
            parts = [part.strip() for part in parts if len(part.strip()) >= 8]
            if parts:
                refused.append((name, text[: call.start()].count("\n") + 1, parts))
    return refused


def unreached(texts, folder="native/io"):
    """The errors that no case has raised."""
    return [r for r in refusals(folder) if not any(all(part in text for part in r[2]) for text in texts)]
