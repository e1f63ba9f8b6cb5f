# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be checked of Windows without one: the library by mingw-w64, its tests by Wine."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.windows import __main__ as windows  # noqa: E402
from tests.windows import environment  # noqa: E402
from tests.windows.plugin import NOT_RUN  # noqa: E402

TOOLS = ("x86_64-w64-mingw32-g++-posix", "make")
WINE = shutil.which("wine64") or shutil.which("/usr/lib/wine/wine64")
POSIX = re.compile(r"#include <(sys/|unistd|fcntl|pthread|dlfcn|sched|poll|dirent)")


@pytest.mark.slow
@pytest.mark.skipif(
    not all(map(shutil.which, TOOLS)) or not WINE, reason="mingw-w64 or Wine is not installed"
)
def test_native_tests_pass_under_wine():
    some = "WINDOWS=tests/python/test_deform.py tests/blender/test_deform.py"
    done = subprocess.run(["make", "test-windows", some], cwd=ROOT, capture_output=True, text=True)
    said = done.stdout + done.stderr
    assert done.returncode == 0, said[-4000:]
    assert re.search(r"(\d+) test cases out of \1 passed", said) and "warning:" not in said
    commands = json.loads((ROOT / "build/windows-x64/compile_commands.json").read_text(encoding="utf-8"))
    assert commands and all(" -Werror " in one["command"] for one in commands)


def test_a_folder_without_enough_that_passed_is_no_success():
    assert windows.table({"a": {"b": ("passed", "")}})
    for found in ({}, {"b": ("passed", ""), "c": ("skipped", "")}, {"b": ("begun", "")}):
        assert not windows.table({"a": found})


def test_a_run_ends_with_its_process(tmp_path, monkeypatch):
    """What a test leaves behind holds the pipe for a minute."""
    (tmp_path / "python.exe").write_text("sleep 60 &\necho $! begun\nexec sleep $1")
    monkeypatch.setattr(environment, "WINE", "/bin/sh")
    monkeypatch.setattr(environment, "LAST_LINES", 0.5)
    for seconds, status, words in (("x", 1, "begun"), ("0", 0, "begun"), ("60", 124, "more than 1 seconds")):
        begun = time.monotonic()
        done = environment.run(tmp_path, seconds, seconds=1)
        assert done.returncode == status and words in done.stdout and time.monotonic() - begun < 20
        os.kill(int(done.stdout.split()[0]), signal.SIGKILL)


def test_tests_excluded_under_wine_exist():
    """A test that is renamed would run, and fail, under its new name."""
    for name in NOT_RUN:
        path, _, function = name.partition("::")
        text = (ROOT / path).read_text(encoding="utf-8")
        assert not function or f"def {function.partition('[')[0]}" in text, name


def test_posix_stands_only_where_windows_has_a_twin():
    """By the files that include its headers: of each there is another one for Windows, or a branch within."""
    for path in sorted((ROOT / "native").rglob("*.[ch]*")):
        text = path.read_text(encoding="utf-8") if path.suffix in (".cpp", ".h") else ""
        if POSIX.search(text) and not path.stem.endswith("_windows"):
            twin = path.with_name(path.name.replace("_posix", "_windows"))
            assert "_WIN32" in text or (twin != path and twin.is_file()), path


def test_python_names_the_encoding_of_every_text_file():
    """Windows' default is not UTF-8."""
    for folder in ("native/python/arapfields", "addon"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            for match in re.finditer(r"\.(?:read_text|write_text)\(", text):
                call = text[match.start() : text.find("\n", match.start()) + 120]
                assert "encoding=" in call, f"{path}: {call.splitlines()[0]}"
            assert not re.search(r"^\s*import fcntl", text.split("else:")[0], flags=re.M), path
