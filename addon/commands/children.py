# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender processes that a batch starts, one per file, and their outcomes."""

import contextlib
import ctypes
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from ..core.runtime.threads import start_thread

# Starts other Blender processes like this one, for the files of a batch.

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


# The Blender processes that a batch starts, one per file, and their outcomes.

WINDOWS = os.name == "nt"


class Children:
    """Context manager of the running Blender processes; ends those that still run when it is left."""

    def __init__(self, environment, limit):
        self.limit, self.running, self.stopped = limit, set(), False
        # Nothing is written to the pipe; the system closes it with this process. On Windows a child inherits
        # only the standard streams, and no child starts while another one reads its input.
        self.pipe = () if WINDOWS else os.pipe()
        self.environment = {**environment, PARENT: str(os.getpid() if WINDOWS else self.pipe[0])}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()
        for descriptor in self.pipe:
            os.close(descriptor)

    def stop(self):
        self.stopped = True
        for process in list(self.running):
            end(process)

    def run(self, command):
        """The outcome of one file; failures of the child are outcomes, not exceptions."""
        begin = time.perf_counter()
        with tempfile.TemporaryDirectory(prefix="arapfields-") as folder:
            report, log = Path(folder) / "report.json", Path(folder) / "log"
            with log.open("wb") as stream:
                code = self.wait([*command, "--report", str(report)], stream)
            outcome = understand(code, report, log.read_text(encoding="utf-8", errors="replace"))
        if code is None:
            outcome["message"] = f"given up after {self.limit:g} s"
        return {**outcome, "seconds": round(time.perf_counter() - begin, 2)}

    def ties(self):
        """Arguments of Popen: a child gets the pipe, and no Ctrl-C, for which the batch ends its children."""
        if WINDOWS:
            return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
        return {"pass_fds": self.pipe[:1], "start_new_session": True}

    def wait(self, command, stream):
        """The child's exit code; None after the time limit."""
        if self.stopped:
            return 130
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=subprocess.STDOUT,
            env=self.environment,
            **self.ties(),
        )
        self.running.add(process)
        try:
            return process.wait(self.limit)
        except subprocess.TimeoutExpired:
            end(process)
            return None
        finally:
            self.running.discard(process)


def end(process):
    """Interrupts a child, which leaves no partial files; kills it if it does not end in time."""
    with contextlib.suppress(OSError, SystemError):  # Windows sends the signal only through a console
        process.send_signal(signal.CTRL_BREAK_EVENT if WINDOWS else signal.SIGINT)
    try:
        process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def read_objects(report):
    """The outcomes of objects in a child's report; [] without a report."""
    try:
        objects = json.loads(report.read_text(encoding="utf-8"))["objects"]
        return [{**o, "status": str(o["status"]), "message": str(o["message"])} for o in objects]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return []


def understand(code, report, log):
    """{"status", "message", "objects"} from a child's exit code, report and log."""
    objects = read_objects(report)
    failures = [o["message"] for o in objects if o["status"] != "done"]
    if code == 0 and objects:
        return {"status": "done", "message": "; ".join(o["message"] for o in objects), "objects": objects}
    if failures:
        status = "partial" if len(failures) < len(objects) else "failed"
        return {"status": status, "message": "; ".join(failures), "objects": objects}
    said = [line for line in log.splitlines() if line.startswith("arapfields")]
    last = said[-1:] or [line for line in log.splitlines() if line.strip()][-1:] or ["it said nothing"]
    reason = last[0].removeprefix("arapfields: ")
    if code is not None and code < 0:
        reason = f"Blender was ended by signal {-code} ({reason})"
    return {"status": "failed", "message": reason, "objects": objects}
