# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks of code that Ctrl-C does not break off, since what they call would take it for another failure."""

import contextlib
import signal
import threading


@contextlib.contextmanager
def uninterrupted():
    """Ctrl-C during the block takes effect at its end.

    Not on other threads, nor where the program that embeds Python has a handler of its own, as Blender
    without a window does: Python cannot put that back, and it raises nothing.
    """
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGINT) is None:
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
