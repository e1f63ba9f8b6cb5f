# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulates a full disk by the system's limit on file sizes."""

import contextlib


@contextlib.contextmanager
def files_of_at_most(size):
    """Limits files of this process to `size` bytes; None: no limit."""
    if size is None:
        yield
        return
    import resource  # not on Windows

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
