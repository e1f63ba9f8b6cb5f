# SPDX-License-Identifier: GPL-3.0-or-later
"""Locks between processes, on single bytes of an open file. They end with the process, however it ends."""

import contextlib
import errno
import os
import sys
import threading
import time

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

PAUSE = 0.05  # seconds between tries, where the system does not wait itself
# Windows takes positions of 32 bits; the byte need not exist. There nobody else reads what is locked: the
# default lies behind what a file holds.
LARGEST = 2**31 - 1
POSITION = threading.Lock()  # Windows locks at the file's position, which threads share


def lock(file, byte=LARGEST, wait=True):
    """Takes a byte's lock. PermissionError or BlockingIOError where another process has it and `wait` is off,
    OSError where the file system has no locks."""
    if sys.platform != "win32":
        fcntl.lockf(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB), 1, byte)
        return
    while True:
        try:
            set_lock(file, byte, msvcrt.LK_NBLCK)
            return
        except OSError as error:
            if error.errno not in (0, errno.EACCES):  # 0: Wine gives no reason
                raise
            if not wait:
                raise PermissionError(errno.EACCES, "another process has the lock") from error
        time.sleep(PAUSE)


def unlock(file, byte=LARGEST):
    """Gives it back; nothing where that cannot be."""
    with contextlib.suppress(OSError):
        if sys.platform != "win32":
            fcntl.lockf(file, fcntl.LOCK_UN, 1, byte)
        else:
            set_lock(file, byte, msvcrt.LK_UNLCK)


def set_lock(file, byte, mode):
    """Windows' own, without waiting."""
    with POSITION:
        os.lseek(file.fileno(), byte & LARGEST, os.SEEK_SET)
        msvcrt.locking(file.fileno(), mode, 1)
