# SPDX-License-Identifier: GPL-3.0-or-later
"""How to start another Blender like this one: a batch gives each file a process of its own."""

import ctypes
import os
import signal
import sys
import time
from pathlib import Path

from ..core.runtime.threads import start_thread

# The descriptor of a pipe that closes when the batch ends, however it does; on Windows the batch's process.
PARENT = "ARAPFIELDS_PARENT"
PATIENCE = 5.0  # seconds in which a Blender that was asked to end may do so


def end_with_parent():
    """In a batch's child: ends this process when the batch is no more, even killed."""
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
                return  # not a batch's child after all
        # An interruption, which leaves no partial file; os.kill would end the process at once on Windows.
        if os.name == "nt":
            signal.raise_signal(signal.SIGTERM)
        else:
            os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(PATIENCE)
        os._exit(130)

    start_thread("parent", watch)


def wait_for_process(number):
    """Returns once that process of Windows has ended."""
    kernel, synchronize, ever = ctypes.WinDLL("kernel32"), 0x100000, 0xFFFFFFFF
    kernel.OpenProcess.restype = ctypes.c_void_p
    process = kernel.OpenProcess(synchronize, False, number)  # none of one that is no more
    kernel.WaitForSingleObject(ctypes.c_void_p(process), ever)


class Launch:
    """The way in which this Blender was started, to start others for single files."""

    def __init__(self, script=None):
        self.script = Path(script).resolve() if script else None

    def command(self, verb, arguments):
        """The command line that runs a verb on one file."""
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
        """The processors shared between so many Blenders at work."""
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        threads = os.environ.get("OMP_NUM_THREADS") or str(max(1, cores // jobs))
        return {**os.environ, "OMP_NUM_THREADS": threads, "PYTHONUNBUFFERED": "1"}
