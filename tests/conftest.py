# SPDX-License-Identifier: GPL-3.0-or-later
"""What every test may use: the folder of real data, and the helper modules beside this file."""

import os
import signal
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

ROOT = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get("ARAPFIELDS_DATA", ROOT.parent / "shared" / "data"))


@pytest.fixture(autouse=True, scope="session")
def interrupts():
    """Python's own handler: a shell that runs the tests in the background has them ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def data_dir():
    """Published neural SDFs and meshes; tests that need them skip where they are absent."""
    if not DATA.is_dir():
        pytest.skip(f"no data at {DATA} (set ARAPFIELDS_DATA)")
    return DATA
