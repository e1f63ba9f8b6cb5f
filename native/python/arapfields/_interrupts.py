# SPDX-License-Identifier: GPL-3.0-or-later
"""Code that Ctrl-C does not interrupt, as the functions it calls report an interrupt as another error."""

import contextlib
import signal
import threading


@contextlib.contextmanager
def uninterrupted():
    """Context manager that defers Ctrl-C to the end of the block.

    It does nothing on other threads, or if the program that embeds Python has installed a handler in C, as
    Blender without a window does: Python cannot restore that one, and it raises no KeyboardInterrupt.
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
