# SPDX-License-Identifier: GPL-3.0-or-later
"""What the package's command line and the extension's have in common: parser, exit codes, progress."""

import argparse
import contextlib
import os
import sys
import threading
from pathlib import Path

from .._files import naming
from .._native import InvalidInput, OutputFile, Task
from .._streams import say

EXIT_CODES = {0: "done", 1: "failed", 2: "bad input or usage", 130: "interrupted"}
POLL = 0.2  # seconds between two drawings of a bar


class OneLineParser(argparse.ArgumentParser):
    """An ArgumentParser that prints errors in one line, with exit code 2, and names the verb's help."""

    def error(self, message):
        say(f"{self.prog}: {message} (see {self.prog} --help)")
        raise SystemExit(2)

    def parse_known_args(self, args=None, namespace=None):
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown


def parser_with_verbs(description, note=""):
    """The parser of the program `arapfields`, and what verbs are added to."""
    codes = ", ".join(f"{code} {text}" for code, text in EXIT_CODES.items())
    root = OneLineParser(
        prog="arapfields", description=description, epilog=f"Exit codes: {codes}. {note}".strip()
    )
    verbs = root.add_subparsers(dest="verb", metavar="VERB", required=True, parser_class=OneLineParser)
    return root, verbs


def failed(verb, reason, code):
    """Prints the reason in one line, and returns the exit code."""
    say(f"{verb}: {' '.join(str(reason).split())}")
    return code


def name_and_margin(text, is_name):
    """(name, margin) of "name:margin"; a whole text that is a name may contain colons."""
    name, colon, margin = text.rpartition(":")
    if colon and not is_name(text):
        with contextlib.suppress(ValueError):
            return name, float(margin)
    return text, 0.0


@contextlib.contextmanager
def shown_progress(read, label="", quiet=False, apart=None):
    """Context manager in which read() → (share, message) is shown on stderr.

    A bar on a terminal; elsewhere a line every `apart` seconds, or nothing.
    """
    live = sys.stderr.isatty()
    if quiet or not (live or apart):
        yield
        return
    ended = threading.Event()

    def draw():
        while not ended.wait(POLL if live else apart):
            show()

    def show():
        share, message = read()
        text = f"{label} {share:4.0%} {message}".strip()
        if live:
            say(f"\r[{'#' * round(24 * share):24}] {text[:66]:66}", end="")
        else:
            say(text)

    thread = threading.Thread(target=draw, name="progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        if live:
            show()
            say("")


# Long calls with a progress bar, and outputs that are replaced atomically.


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
