# SPDX-License-Identifier: GPL-3.0-or-later
"""Long calls with a progress bar, and outputs that appear whole or not at all."""

import contextlib
import os
import shutil
import signal
import sys
import tempfile
import threading
from pathlib import Path

from .._native import InvalidInput, Task

POLL = 0.1  # seconds between looks at a task


@contextlib.contextmanager
def uninterrupted():
    """Ctrl-C during the block takes effect at its end."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    waiting = []
    before = signal.signal(signal.SIGINT, lambda *_: waiting.append(True))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if waiting:
        signal.raise_signal(signal.SIGINT)


def with_progress(label, call, quiet=False):
    """The result of `call(task)`, made on a thread of its own so that Ctrl-C cancels it.

    A bar is drawn on stderr where that is a terminal and `quiet` is not set.
    """
    task = Task()
    outcome = {}
    finished = threading.Event()  # a join that Ctrl-C interrupts would take the thread for ended

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
        if bar is not None:
            bar.close()
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
    if bar is not None:
        bar.set_postfix_str(message, refresh=False)
        bar.update(progress - bar.n)
        bar.refresh()


class Outputs:
    """Files that a verb promises: places are checked first, contents put there together at the end."""

    def __init__(self):
        self._pending = []  # (target, temporary folder)

    def check(self, path, suffixes, flag):
        """The path of an output to be; InvalidInput where it cannot become a file of these kinds."""
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
        return path

    def write(self, path, writer):
        """Calls `writer(temporary path)`; the file takes its place when the block ends without an error."""
        folder = tempfile.mkdtemp(prefix=".arapfields-", dir=path.parent)
        self._pending.append((path, Path(folder)))
        writer(Path(folder) / path.name)

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        try:
            if kind is None:
                for path, folder in self._pending:
                    os.replace(folder / path.name, path)
        finally:
            for _, folder in self._pending:
                shutil.rmtree(folder, ignore_errors=True)
