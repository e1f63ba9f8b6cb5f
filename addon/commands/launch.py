# SPDX-License-Identifier: GPL-3.0-or-later
"""Starts other Blender processes like this one, for the files of a batch."""

import ctypes
import os
import signal
import sys
import time
from pathlib import Path

from ..core.runtime.threads import start_thread

# Descriptor of a pipe that the system closes when the batch ends or is killed; on Windows the batch's ID.
PARENT = "ARAPFIELDS_PARENT"
PATIENCE = 5.0  # seconds from the interrupt of a child until it is ended by force


def end_with_parent():
    """In a child of a batch: interrupts this process once the batch has ended or was killed."""
    try:
        parent = int(os.environ.pop(PARENT, ""))
    except ValueError:
        return

    def watch():
        if os.name == "nt":
            wait_for_process(parent)
        else:
            try:
                os.read(parent, 1)
            except OSError:
                return  # not a child of a batch
        # An interrupt leaves no partial file; on Windows os.kill would end the process at once.
        if os.name == "nt":
            signal.raise_signal(signal.SIGTERM)
        else:
            os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(PATIENCE)
        os._exit(130)

    start_thread("parent", watch)


def wait_for_process(number):
    """Waits until a process ends, on Windows."""
    kernel, synchronize, ever = ctypes.WinDLL("kernel32"), 0x100000, 0xFFFFFFFF
    kernel.OpenProcess.restype = ctypes.c_void_p
    process = kernel.OpenProcess(synchronize, False, number)  # None for a process that has ended
    kernel.WaitForSingleObject(ctypes.c_void_p(process), ever)


class Launch:
    """The command with which this Blender was started, to start others."""

    def __init__(self, script=None):
        self.script = Path(script).resolve() if script else None

    def command(self, verb, arguments):
        """The command line of a verb for one file."""
        import bpy

        from ..blender import host

        if self.script and host.is_module():
            return [sys.executable, str(self.script.with_name(f"{verb}.py")), *arguments]
        given = list(sys.argv[1:])
        if self.script:
            place = given.index("--")
            before = [*given[:place], "--"]
            at = next(i for i, text in enumerate(before) if text in ("-P", "--python")) + 1
            before[at] = str(self.script.with_name(f"{verb}.py"))
            return [bpy.app.binary_path, *before, *arguments]
        at = next(i for i, text in enumerate(given) if text in ("-c", "--command"))
        return [bpy.app.binary_path, *given[: at + 2], verb, *arguments]

    def environment(self, jobs):
        """The environment of children, with the processors divided among `jobs` processes."""
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        threads = os.environ.get("OMP_NUM_THREADS") or str(max(1, cores // jobs))
        return {**os.environ, "OMP_NUM_THREADS": threads, "PYTHONUNBUFFERED": "1"}
