# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources stand as clang-format and ruff leave them (`make format` does it)."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOOLS = Path(sys.executable).parent


def run(tool, *arguments):
    if not (TOOLS / tool).exists():
        pytest.skip(f"{tool} is not installed beside Python")
    done = subprocess.run([TOOLS / tool, *arguments], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_native_sources_are_formatted():
    sources = [str(path) for folder in ("native", "tests") for path in (ROOT / folder).rglob("*.[ch]*")]
    sources = sorted(path for path in sources if path.endswith((".h", ".cpp")))
    assert len(sources) > 100
    run("clang-format", "--dry-run", "--Werror", *sources)


def test_python_sources_are_formatted():
    run("ruff", "format", "--check", "-q", ".")


def test_python_sources_pass_the_linter():
    run("ruff", "check", "-q", ".")
