# SPDX-License-Identifier: GPL-3.0-or-later
"""What the package's command line and the extension's have in common: parser, exit codes, progress."""

import argparse
import contextlib
import sys
import threading

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
