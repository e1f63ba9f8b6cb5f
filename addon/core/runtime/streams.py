# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard output and error, which Blender may have been started without, as services and jobs do."""

import os
import sys


def open_streams():
    """Replaces standard streams that are missing or closed by ones that swallow what is written.

    Their descriptors are taken, so that no file that is opened later gets Blender's messages.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free descriptor
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None or stream.closed:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
