# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender that takes walks: reads one a line, as JSON, and answers with lines of JSON.

{"step": n} before each step, {"taken": what was done} after it, at last {"end": "" or what is broken}.
"""

import faulthandler
import json
import os
import sys
import tempfile
import traceback
from pathlib import Path

os.environ.setdefault("BLENDER_USER_RESOURCES", tempfile.mkdtemp())

import bpy  # noqa: F401

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]
ERRORS = ("Traceback (most recent call last)", "Error in bpy.app")


class Output:
    """What Blender and Python print, in a file."""

    def __init__(self):
        self.file = tempfile.TemporaryFile()  # noqa: SIM115 (for the process)
        os.dup2(self.file.fileno(), 1)
        os.dup2(self.file.fileno(), 2)
        faulthandler.enable(os.fdopen(os.dup(int(os.environ.get("WALK_CRASHES", "2"))), "w"))

    def take(self):
        sys.stdout.flush()
        sys.stderr.flush()
        end = os.lseek(self.file.fileno(), 0, os.SEEK_CUR)
        self.file.seek(0)
        text = self.file.read(end).decode(errors="replace")
        self.file.seek(0)
        self.file.truncate()
        return text


def main():
    answers = os.fdopen(os.dup(1), "w")

    def say(**what):
        print(json.dumps(what), file=answers, flush=True)

    output = Output()
    import addon
    from tests.blender.walk import world
    from tests.fuzz.walk.rules import All, Shapes
    from tests.fuzz.walk.run import Walk

    addon.register()
    world.few_centers()
    for line in sys.stdin:
        walk = Walk.of(line)
        try:
            scene = (Shapes if walk.kind == "SHAPES" else All)(walk.seed)
            output.take()
            for number, (name, seed) in enumerate(walk.steps):
                say(step=number)
                said = scene.step(name, seed)
                printed = output.take()
                if any(error in printed for error in ERRORS):
                    raise RuntimeError(printed[-3000:])
                say(taken=said)
            say(end="")
        except Exception as error:
            text = str(error) if type(error).__name__ == "Broken" else traceback.format_exc()[-4000:]
            say(end=text or "an error without text")
    answers.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
