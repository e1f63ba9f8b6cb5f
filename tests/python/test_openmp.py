# SPDX-License-Identifier: GPL-3.0-or-later
"""How the native library's OpenMP is loaded: idle threads spin shortly, unless somebody decided otherwise."""

import os
import re
import subprocess
import sys

import pytest

CODE = "import os, arapfields; print('GOMP_SPINCOUNT' in os.environ)"


@pytest.mark.parametrize("given, expected", [(None, "1000"), ("77", "77")])
def test_idle_threads_spin_shortly_or_as_told(given, expected):
    decided = {"OMP_WAIT_POLICY", "GOMP_SPINCOUNT", "OMP_DISPLAY_ENV"}
    environment = {name: value for name, value in os.environ.items() if name not in decided}
    environment |= {"OMP_DISPLAY_ENV": "VERBOSE"} | ({} if given is None else {"GOMP_SPINCOUNT": given})
    run = subprocess.run([sys.executable, "-c", CODE], env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    found = re.findall(r"GOMP_SPINCOUNT = '(\d+)'", run.stderr)
    if not found:
        pytest.skip("this OpenMP does not tell its settings")
    assert set(found) == {expected}
    assert run.stdout.strip() == str(given is not None)  # our setting does not outlive the loading
