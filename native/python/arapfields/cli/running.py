# SPDX-License-Identifier: GPL-3.0-or-later
"""Long calls with a progress bar, and outputs that are replaced atomically."""

import os
import sys
import threading
from pathlib import Path

from .._files import naming
from .._native import InvalidInput, OutputFile, Task
from .._streams import swallow

POLL = 0.1  # seconds between reads of a task's progress


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

    bar = _bar(label, quiet)
    worker = threading.Thread(target=work, daemon=True)
    worker.start()
    try:
        while not finished.wait(POLL):
            _show(bar, task.progress, task.message)
        if "result" in outcome:
            _show(bar, 1.0, "")
    except KeyboardInterrupt:
        task.cancel()
        finished.wait()
        raise
    finally:
        _with(bar, lambda: bar.close())
    if "error" in outcome:
        raise outcome["error"]
    return outcome["result"]


def _bar(label, quiet):
    if quiet or not sys.stderr.isatty():
        return None
    try:
        from tqdm import tqdm
    except ImportError:
        return None
    layout = "{desc} {percentage:3.0f}% |{bar}| {elapsed}{postfix}"
    return tqdm(total=1.0, desc=label, bar_format=layout, leave=True)


def _show(bar, progress, message):
    def draw():
        bar.set_postfix_str(message, refresh=False)
        bar.update(progress - bar.n)
        bar.refresh()

    _with(bar, draw)


def _with(bar, draw):
    """Draws a bar, if there is one and its terminal is still there."""
    if bar is not None:
        try:
            draw()
        except (OSError, ValueError):
            swallow(sys.stderr)


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
