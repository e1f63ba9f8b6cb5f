# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a verb of the extension's command line in the Blender worker."""

import contextlib
import io
import json
from pathlib import Path

from support.files.archives import files_of_at_most


def command(arguments, largest, answer):
    """Writes [exit code, stdout, stderr] to the file `answer`."""
    from addon.commands.main import run

    out, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors), files_of_at_most(largest):
        code = run(arguments)
    Path(answer).write_text(json.dumps([code, out.getvalue(), errors.getvalue()]))
