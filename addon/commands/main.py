# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a command and returns its exit code."""

import contextlib
import errno
import importlib
import platform
import signal
import sys

from ..core.errors import UserError, as_user_error
from ..core.runtime import native, self_check


def run(arguments, script=None):
    """Runs one verb and returns the exit code; errors are one line on stderr.

    `script` is the Python file that Blender was started with; None for a command of Blender's own.
    """
    try:
        native.library()
    except UserError as error:
        if arguments[:1] == ["check"]:  # whose report says why the library is missing
            return verb("check")()
        print(f"arapfields: {error}", file=sys.stderr, flush=True)
        return 2
    from arapfields._streams import open_streams
    from arapfields.cli.command_line import failed

    from .batch import Launch, end_with_parent
    from .parser import parse

    open_streams()
    try:
        options = parse(arguments)
    except SystemExit as stop:
        return stop.code or 0
    with interruptible():
        end_with_parent()
        try:
            return verb(options.verb)(options, Launch(script))
        except KeyboardInterrupt:
            return failed("arapfields", "interrupted", 130)
        except (UserError, OSError, ValueError) as error:
            full = isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)
            return failed("arapfields", as_user_error(error), 1 if full else 2)


def verb(name):
    """The function of a verb; only verbs for one file import bpy."""
    if name == "check":
        return run_check
    module = importlib.import_module(".batch" if name == "batch" else ".single", __package__)
    return getattr(module, f"run_{name if name in ('batch', 'bake', 'skin') else 'single'}")


def run_check(*_):
    """check: a report on the machine, Blender, and small problems with known results; returns the exit code,
    0 if every result is right, else 1."""
    import bpy

    lines, works = self_check.run()
    print(f"Blender {bpy.app.version_string}, {platform.platform()}")
    print("\n".join([*lines, "everything works" if works else "NOT EVERYTHING WORKS"]), flush=True)
    return 0 if works else 1


@contextlib.contextmanager
def interruptible():
    """Context manager in which Ctrl-C and SIGTERM raise KeyboardInterrupt; Blender has its own handlers."""
    asked = [signal.SIGINT, signal.SIGTERM]
    if hasattr(signal, "SIGBREAK"):
        asked.append(signal.SIGBREAK)  # on Windows, from a batch (batch.py)
    before = [signal.signal(number, signal.default_int_handler) for number in asked]
    try:
        yield
    finally:
        for number, handler in zip(asked, before, strict=True):
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)
