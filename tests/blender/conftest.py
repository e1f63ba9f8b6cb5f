# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs tests in Blender without a window (PyPI's bpy), with an empty user folder.

ARAPFIELDS_WORKER   command that runs a Python file in another Blender instead, as `blender --background
                    --factory-startup --python-use-system-env --python`; it must import arapfields and pytest
"""

import inspect
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from support.blender.inside import require_bpy

ROOT = Path(__file__).resolve().parents[2]
WORKER = shlex.split(os.environ.get("ARAPFIELDS_WORKER", ""))
PROGRAM = ROOT / "tests/support/blender/worker.py"
SKIPPED = "skipped: "  # begins an answer, as there


def isolated(folder):
    """Environment variables that isolate Blender from the user's settings."""
    paths = [str(ROOT), str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")]
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(filter(None, paths)),
        "BLENDER_USER_RESOURCES": str(folder),
        "TMPDIR": str(folder),
        "OMP_NUM_THREADS": "1",  # enough for the small solves here
        "MALLOC_PERTURB_": "165",  # glibc overwrites freed memory, so that later reads of it fail
    }


class Blender:
    """The worker process; started on first use, and again after a crash."""

    def __init__(self, folder):
        self.folder, self.process = folder, None

    def call(self, file, function, arguments):
        if self.process is None or self.process.poll() is not None:
            self.process = subprocess.Popen(
                [*(WORKER or [sys.executable]), str(PROGRAM)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                env=isolated(self.folder),
            )
        order = {"file": file, "function": function, "arguments": arguments}
        self.process.stdin.write(json.dumps(order, default=str) + "\n")
        self.process.stdin.flush()
        answer = next((line for line in self.process.stdout if line.startswith('"')), "")  # after the banner
        if not answer:
            pytest.fail(f"Blender ended with status {self.process.wait()}")
        said = json.loads(answer)
        if said.startswith(SKIPPED):
            pytest.skip(said.removeprefix(SKIPPED))
        if said:
            pytest.fail(said, pytrace=False)

    def close(self):
        if self.process is not None:
            self.process.stdin.close()
            self.process.wait()


@pytest.fixture(scope="session")
def blender(tmp_path_factory):
    if not WORKER:
        require_bpy()
    worker = Blender(tmp_path_factory.mktemp("blender"))
    yield worker
    worker.close()


@pytest.fixture
def command(blender, tmp_path_factory):
    """command(*arguments, check=True, largest=None): the extension's command line in the worker.

    `largest` limits the size of files, in bytes. Returns the same as subprocess.run.
    """
    answer = tmp_path_factory.mktemp("command") / "answer.json"

    def run(*arguments, check=True, largest=None):
        words = [str(word) for word in arguments]
        order = {"arguments": words, "largest": largest, "answer": answer}
        blender.call(str(ROOT / "tests/support/blender/commanded.py"), "command", order)
        done = subprocess.CompletedProcess(words, *json.loads(answer.read_text()))
        assert not check or done.returncode == 0, done
        return done

    return run


@pytest.fixture
def user_folder(tmp_path):
    return isolated(tmp_path)


def pytest_itemcollected(item):
    if item.get_closest_marker("in_blender"):
        item.fixturenames.insert(0, "blender")


def pytest_pyfunc_call(pyfuncitem):
    """Runs the bodies of tests marked in_blender in the worker."""
    if pyfuncitem.get_closest_marker("in_blender"):
        given, names = pyfuncitem.funcargs, inspect.signature(pyfuncitem.obj).parameters
        worker, function = given["blender"], pyfuncitem.originalname
        worker.call(str(pyfuncitem.path), function, {name: given[name] for name in names})
        return True
    return None
