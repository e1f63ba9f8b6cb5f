# SPDX-License-Identifier: GPL-3.0-or-later
"""Helpers of tests of batches: folders of inputs, and a stand-in for Blender.

python tests/support/programs/batches.py FLAGS runs a batch with the stand-in.
"""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from addon.commands.batch import FOLDER, Record, run_batch
from addon.commands.main import interruptible
from addon.commands.parser import parse


def make_folders(place):
    (place / "in/sub").mkdir(parents=True)
    for name in ("b.ply", "a.obj", "c.STL", "notes.txt", ".hidden.ply", "sub/d.ply"):
        (place / "in" / name).write_text(name)
    return place


def make_slow_inputs(place, count):
    """A folder `in` with `count` inputs that take a moment each."""
    (place / "in").mkdir()
    for i in range(count):
        (place / f"in/slow{i:02d}.ply").write_text(str(i))
    return place


def batch(folders, *further, output="out"):
    where = ["-i", str(folders / "in"), "-o", str(folders / output)]
    return parse(["batch", "--style", "cube", *where, *further])


class FakeLaunch:
    """Runs a short Python program instead of Blender: it writes, fails or crashes by the file's name."""

    code = """
import json, os, sys
a = sys.argv; source, target, report = (a[a.index(flag) + 1] for flag in ("-i", "-o", "--report"))
with open(os.path.join(os.path.dirname(target), "starts"), "a") as starts:
    starts.write(os.path.basename(source) + "\\n")
if "dies" in source: os.kill(os.getpid(), 11)
if "hangs" in source: import time; time.sleep(60)
good = "fails" not in source
if "slow" in source: import time; time.sleep(0.05)
if good: open(target, "w").write("made")
note = {"object": "x", "status": "done" if good else "failed", "message": "x: made" if good else "x: no"}
open(report, "w").write(json.dumps({"objects": [note]}))
sys.exit(0 if good else 1)
"""

    def command(self, verb, arguments):
        return [sys.executable, "-I", "-S", "-c", self.code, verb, *arguments]

    def environment(self, jobs):
        return dict(os.environ)


def statuses(folder):
    """{input: status} of the record."""
    record = Record(folder)
    names = [
        path.relative_to(folder / FOLDER).as_posix()[:-5] for path in (folder / FOLDER).rglob("*.*.json")
    ]
    return {name: record.entry(name)["status"] for name in sorted(names)}


def starts(folder):
    """Names of the inputs, once per start of a Blender."""
    return sorted((folder / "starts").read_text().split())


if __name__ == "__main__":
    with interruptible():
        sys.exit(run_batch(parse(["batch", *sys.argv[1:]]), FakeLaunch()))
