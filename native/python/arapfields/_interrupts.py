# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks of code that Ctrl-C does not break off, since what they call would take it for another failure."""

import contextlib
import signal
import threading


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
