# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender processes that a batch starts, one per file, and their outcomes."""

import contextlib
import json
import os
import signal
import subprocess
import tempfile
import time
from pathlib import Path

from .launch import PARENT

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
