# SPDX-License-Identifier: GPL-3.0-or-later
"""Run in the Blender worker: a verb of the extension's command line, as `blender --command arapfields` does."""

import contextlib
import io
import json
from pathlib import Path


@contextlib.contextmanager
def files_of_at_most(size):
    """No file gets larger, in bytes; stands for a full disk."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size or before[0], before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def command(arguments, largest, answer):
    """Writes [exit code, stdout, stderr] to the file `answer`."""
    from addon.commands.main import run

    out, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors), files_of_at_most(largest):
        code = run(arguments)
    Path(answer).write_text(json.dumps([code, out.getvalue(), errors.getvalue()]))
