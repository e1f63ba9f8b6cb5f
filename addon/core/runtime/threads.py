# SPDX-License-Identifier: GPL-3.0-or-later
"""Starting of threads, with low priority beside a window."""

import contextlib
import os
import sys
import threading

NICENESS = 10  # added to the nice value of low-priority threads
PREFIX = "arapfields "  # of the threads' names


def start_thread(name, work, low_priority=False):
    """Starts `work()` on a daemon thread; returns the thread."""

    def run():
        if low_priority:
            lower_thread_priority()
        work()

    thread = threading.Thread(target=run, name=f"{PREFIX}{name}", daemon=True)
    thread.start()
    return thread


def own_threads():
    """The threads of the extension that are running."""
    return [thread for thread in threading.enumerate() if thread.name.startswith(PREFIX)]


def lower_thread_priority():
    """Lowers the priority of the calling thread, and of threads that it starts later, below the window's.

    On Linux only: on other systems the nice value belongs to the whole process.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError):
            thread = threading.get_native_id()
            niceness = min(19, os.getpriority(os.PRIO_PROCESS, thread) + NICENESS)
            os.setpriority(os.PRIO_PROCESS, thread, niceness)
