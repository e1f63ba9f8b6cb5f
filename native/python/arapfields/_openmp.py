# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads the native library so that its idle worker threads soon sleep.

OpenMP's threads by default spin for milliseconds at the end of each parallel loop. On a computer that has
other things to do, or few cores, they then take the time of those that still work: a deformation took up to
twenty times as long. Threads that sleep at once cost more to wake than short loops last. A spin of some
microseconds avoids both (docs/performance.md). OpenMP reads its settings when it is loaded; whoever set them,
or loaded it, is obeyed.
"""

import os

if not {"OMP_WAIT_POLICY", "GOMP_SPINCOUNT"} & set(os.environ):
    os.environ["GOMP_SPINCOUNT"] = "1000"
    from . import _native  # noqa: F401

    del os.environ["GOMP_SPINCOUNT"]
