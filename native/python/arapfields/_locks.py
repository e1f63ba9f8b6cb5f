# SPDX-License-Identifier: GPL-3.0-or-later
"""Locks between processes, on single bytes of an open file. They end with the process, however it ends."""

import contextlib
import errno
import os
import sys
import time

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

PAUSE = 0.05  # seconds between tries, where the system does not wait itself
LARGEST = 2**31 - 1  # Windows takes positions of 32 bits; the byte need not exist


def lock(file, byte=0, wait=True):
    """Takes a byte's lock. PermissionError or BlockingIOError where another process has it and `wait` is off,
    OSError where the file system has no locks."""
    if sys.platform != "win32":
        fcntl.lockf(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB), 1, byte)
        return
    while True:
        os.lseek(file.fileno(), byte & LARGEST, os.SEEK_SET)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
            return
        except OSError as error:
            if error.errno not in (0, errno.EACCES):  # 0: Wine gives no reason
                raise
            if not wait:
                raise PermissionError(errno.EACCES, "another process has the lock") from error
        time.sleep(PAUSE)


def unlock(file, byte=0):
    """Gives it back; nothing where that cannot be."""
    with contextlib.suppress(OSError):
        if sys.platform != "win32":
            fcntl.lockf(file, fcntl.LOCK_UN, 1, byte)
        else:
            os.lseek(file.fileno(), byte & LARGEST, os.SEEK_SET)
            msvcrt.locking(file.fileno(), msvcrt.LK_UNLCK, 1)
