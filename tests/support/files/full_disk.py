# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands for a full disk: the system refuses to make files longer."""

import contextlib


@contextlib.contextmanager
def files_of_at_most(size):
    """No file of this process gets longer than `size` bytes; None is no limit."""
    if size is None:
        yield
        return
    import resource  # Windows has none

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
