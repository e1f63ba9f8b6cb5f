# SPDX-License-Identifier: GPL-3.0-or-later
"""Long calls with a progress bar, and outputs that are replaced atomically."""

import os
import threading
from pathlib import Path

from .._files import naming
from .._native import InvalidInput, OutputFile, Task
from .command_line import POLL, shown_progress


def place(path):
    """The path with links resolved, or the absolute path: Wine cannot resolve long ones."""
    try:
        return os.path.realpath(path)
    except OSError:
        return os.path.abspath(path)


def with_progress(label, call, quiet=False):
    """Returns the result of `call(task)`, run on a thread so that Ctrl-C cancels it.

    Draws a progress bar if stderr is a terminal and `quiet` is not set.
    """
    task = Task()
    outcome = {}
    finished = threading.Event()  # a join() interrupted by Ctrl-C would mark the thread as ended

    def work():
        try:
            outcome["result"] = call(task)
        except BaseException as error:
            outcome["error"] = error
        finally:
            finished.set()

    def progress():
        return (1.0, "") if "result" in outcome else (task.progress, task.message)

    worker = threading.Thread(target=work, daemon=True)
    with shown_progress(progress, label, quiet):
        worker.start()
        try:
            while not finished.wait(POLL):  # a wait without an end would not see Ctrl-C on Windows
                pass
        except KeyboardInterrupt:
            task.cancel()
            finished.wait()
            raise
    if "error" in outcome:
        raise outcome["error"]
    return outcome["result"]


class Outputs:
    """The output files of a verb: paths are checked first, files written later and renamed together."""

    def __init__(self):
        self._promised = {}  # {resolved path: its flag}
        self._pending = []

    def check(self, path, suffixes, flag):
        """Returns the path; InvalidInput if no file with one of these suffixes can be written to it."""
        path = Path(path)
        if path.suffix.lower() not in suffixes:
            raise InvalidInput(f"{flag}: {path} has an unknown extension; allowed are {', '.join(suffixes)}")
        if path.is_dir():
            raise InvalidInput(f"{flag}: {path} is a directory; a file name is needed")
        if not path.parent.is_dir():
            raise InvalidInput(f"{flag}: {path} cannot be made; there is no directory {path.parent}")
        if not os.access(path.parent, os.W_OK):
            raise InvalidInput(
                f"{flag}: {path} cannot be made; the directory {path.parent} cannot be written to"
            )
        OutputFile(path).discard()  # InvalidInput if it is not a regular file
        other = self._promised.setdefault(place(path), flag)
        if other != flag:
            raise InvalidInput(f"{flag}: {path} is {other}'s file too; each output needs one of its own")
        return path

    def write(self, path, writer):
        """Calls `writer(temporary path)`; the file is renamed if the block ends without an error."""
        output = OutputFile(path)
        self._pending.append(output)
        with naming(output, path):
            writer(Path(output.partial))
        output.finish()  # reports errors before any file is renamed

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        try:
            if kind is None:
                for output in self._pending:
                    output.commit()
        finally:
            for output in self._pending:
                output.discard()
