# SPDX-License-Identifier: GPL-3.0-or-later
"""Locks on bytes of a file: threads of one process, and another process."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

from arapfields._locks import lock, unlock

THREADS, ROUNDS = 8, 100
LOCK_ALL = """
import sys
from arapfields._locks import lock
file = open(sys.argv[1], "ab")
for byte in range(int(sys.argv[2])):
    lock(file, byte, wait=False)
"""


def test_threads_lock_bytes_of_one_file_and_leave_none_locked(tmp_path):
    with (tmp_path / "lock").open("ab") as file, ThreadPoolExecutor(THREADS) as pool:

        def work(byte):
            for _ in range(ROUNDS):
                lock(file, byte, wait=False)
                unlock(file, byte)

        list(pool.map(work, range(THREADS)))
        command = [sys.executable, "-c", LOCK_ALL, str(file.name), str(THREADS)]
        assert subprocess.run(command, timeout=60).returncode == 0
