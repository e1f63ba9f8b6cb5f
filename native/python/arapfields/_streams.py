# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard output and error, which a program may lack, as services and programs without a console do."""

import os
import sys


def open_streams():
    """Replaces standard streams that are missing or closed by ones that swallow what is written.

    Their descriptors are taken, so that no file that is opened later gets the messages of libraries.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free descriptor
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None or stream.closed:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115


def say(text, name="stderr", end="\n"):
    """Prints a text to the standard stream of this name; a stream that fails gets nothing more."""
    stream = getattr(sys, name)
    try:
        print(text, end=end, file=stream, flush=True)
    except (OSError, ValueError):
        swallow(stream)


def swallow(stream):
    """Makes a stream that fails swallow what is still to be written, also at the program's end."""
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
    except (OSError, ValueError):
        pass
