# SPDX-License-Identifier: GPL-3.0-or-later
"""Ctrl-C during a native call in the main thread: KeyboardInterrupt, and the library works on."""

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from support.geometry import cases
from support.programs.cli import wait_until_loaded

import arapfields as af
from arapfields._interrupts import uninterrupted

TESTS = str(Path(__file__).parents[1])
SCRIPT = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.path.insert(0, sys.argv[1])
import arapfields as af
from support.geometry import cases
samples, handles = cases.bar_samples(), cases.bar_handles()
options = dict(width=32, layers=3, batch=100)
print("ready", flush=True)
try:
    af.deform(samples, handles, af.DeformOptions(iterations=10_000_000, **options))
except KeyboardInterrupt:
    print("interrupted", flush=True)
print(af.deform(samples, handles, af.DeformOptions(iterations=3, **options)).report.iterations)
"""


def test_ctrl_c_in_a_script():
    running = subprocess.Popen([sys.executable, "-c", SCRIPT, TESTS], stdout=subprocess.PIPE, text=True)
    try:
        assert running.stdout.readline() == "ready\n"
        time.sleep(0.5)
        running.send_signal(signal.SIGINT)
        printed, _ = running.communicate(timeout=60)
    finally:
        running.kill()
    assert printed.split() == ["interrupted", "3"] and running.returncode == 0


@pytest.mark.parametrize("delay", np.linspace(0.05, 0.4, 6).round(2))
def test_ctrl_c_while_the_library_is_imported_is_no_failed_import(delay):
    """Of Python's end by Ctrl-C, or at its sleep; it was an ImportError in a quarter of tries."""
    script = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    script += "import arapfields, time; time.sleep(60)"
    running = subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.PIPE, text=True)
    try:
        wait_until_loaded(running)
        time.sleep(delay)
        running.send_signal(signal.SIGINT)
        _, said = running.communicate(timeout=60)
    finally:
        running.kill()
    assert said.splitlines()[-1] == "KeyboardInterrupt" and running.returncode != 1, said


def interrupted_after(seconds, call):
    """Sends this process SIGINT while the call runs in the main thread."""
    timer = threading.Timer(seconds, signal.raise_signal, [signal.SIGINT])
    timer.start()
    try:
        call()
    finally:
        timer.join()


def test_a_task_is_cancelled_by_it():
    task = af.Task()
    options = af.DeformOptions(width=32, layers=3, batch=100, iterations=10_000_000)
    with pytest.raises(KeyboardInterrupt):
        interrupted_after(
            0.3, lambda: af.deform(cases.bar_samples(), cases.bar_handles(), options, task=task)
        )
    assert task.cancelled


def test_a_handler_that_raises_nothing_changes_nothing():
    seen = []
    before = signal.signal(signal.SIGINT, lambda *_: seen.append(time.monotonic()))
    options = af.DeformOptions(width=32, layers=3, batch=100, iterations=10_000_000, time_budget=1.0)
    try:
        field = None

        def call():
            nonlocal field
            field = af.deform(cases.bar_samples(), cases.bar_handles(), options)

        interrupted_after(0.2, call)
    finally:
        signal.signal(signal.SIGINT, before)
    assert len(seen) == 1 and field.report.out_of_time


def test_a_handler_that_is_not_pythons_stays():
    """Blender without a window handles Ctrl-C itself; Python has None for its handler, and cannot set it."""
    none = mock.patch.object(signal, "getsignal", return_value=None)
    with none, mock.patch.object(signal, "signal") as put, uninterrupted():
        pass
    assert not put.called
