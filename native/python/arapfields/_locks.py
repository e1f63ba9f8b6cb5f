# SPDX-License-Identifier: GPL-3.0-or-later
"""Locks between processes on single bytes of an open file; the system releases them with the process."""

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

PAUSE = 0.05  # seconds between attempts on Windows, which has no blocking call
# Windows takes positions of 32 bits; the byte need not exist. Others cannot read a locked byte there: the
# default is beyond the end of files.
LARGEST = 2**31 - 1
POSITION = threading.Lock()  # Windows locks at the file position, which threads share


def lock(file, byte=LARGEST, wait=True):
    """Locks a byte. PermissionError or BlockingIOError if another process has locked it and `wait` is False,
    OSError if the file system does not support locks."""
    if sys.platform != "win32":
        fcntl.lockf(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB), 1, byte)
        return
    while True:
        try:
            set_lock(file, byte, msvcrt.LK_NBLCK)
            return
        except OSError as error:
            if error.errno not in (0, errno.EACCES):  # 0: from Wine
                raise
            if not wait:
                raise PermissionError(errno.EACCES, "another process has the lock") from error
        time.sleep(PAUSE)


def unlock(file, byte=LARGEST):
    """Unlocks a byte; errors are ignored."""
    with contextlib.suppress(OSError):
        if sys.platform != "win32":
            fcntl.lockf(file, fcntl.LOCK_UN, 1, byte)
        else:
            set_lock(file, byte, msvcrt.LK_UNLCK)


def set_lock(file, byte, mode):
    """Locks or unlocks a byte on Windows, without waiting."""
    with POSITION:
        os.lseek(file.fileno(), byte & LARGEST, os.SEEK_SET)
        msvcrt.locking(file.fileno(), mode, 1)
