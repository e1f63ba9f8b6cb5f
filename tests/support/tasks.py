# SPDX-License-Identifier: GPL-3.0-or-later
"""Cancelling a call while it works."""

import threading
import time
from contextlib import contextmanager


@contextmanager
def cancelled_when(task, is_enough):
    """Cancels a task from another thread once is_enough(seen); `seen`, the values of its progress until then,
    is what the context manager gives."""
    seen = []

    def watch():
        while not is_enough(seen):
            seen.append(task.progress)
            time.sleep(0.01)
        task.cancel()

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        yield seen
    finally:
        watcher.join()
