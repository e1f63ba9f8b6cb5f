# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the C++ test program, one pytest test for each of its suites."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CANDIDATES = [os.environ.get("ARAPFIELDS_NATIVE_TESTS", ""), "build/wheel/tests/native_tests"]
SOURCES = sorted(Path(__file__).parent.glob("test_*.cpp"))


def program():
    for candidate in filter(None, CANDIDATES):
        if (path := ROOT / candidate).is_file():
            return path
    raise AssertionError("native_tests was not built (make test builds it)")


@pytest.mark.parametrize("suite", [path.stem.removeprefix("test_") for path in SOURCES])
def test_suite(suite):
    command = [str(program()), f"--run_test={suite}", "--color_output=no"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
