# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands and Python environments isolated from this one, the tested build, and its files."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

# Commands and Python environments isolated from this environment.

LEFT_OUT = ("CMAKE_PREFIX_PATH", "LD_LIBRARY_PATH", "PYTHONPATH", "PYTHONPYCACHEPREFIX", "VIRTUAL_ENV")


def run(*command, code=0, **keywords):
    """The output of a command, which must end with `code`; stderr=subprocess.STDOUT includes its errors."""
    environment = {key: value for key, value in os.environ.items() if key not in LEFT_OUT}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    command = [str(part) for part in command]
    done = subprocess.run(command, text=True, env=environment, **(pipes | keywords))
    assert done.returncode == code, (done.stdout + (done.stderr or ""))[-4000:]
    return done.stdout


def python_of(version):
    """A Python of that version, (major, minor), in PATH or of pyenv; None without one."""
    name = "python{}.{}".format(*version)
    pyenv = sorted(Path.home().glob(f".pyenv/versions/*/bin/{name}"))
    for program in filter(None, [shutil.which(name), *pyenv]):
        if not subprocess.run([program, "-c", "import venv"], capture_output=True).returncode:
            return program
    return None


def fresh(folder, *wanted, python=sys.executable):
    """The Python of a new virtual environment in `folder` with the packages `wanted`."""
    run(python, "-m", "venv", folder / "venv")
    python = folder / "venv" / "bin" / "python"
    run(python, "-m", "pip", "install", "-q", "--disable-pip-version-check", *wanted)
    return python


# The tested build, and its files installed by CMake.

ROOT = Path(__file__).resolve().parents[3]
NATIVE = ROOT / "native"
BUILD = ROOT / "build" / "wheel"
CMAKE = shutil.which("cmake", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
PUBLIC = sorted((NATIVE / "include" / "arapfields").glob("*.h"))


def cached(name):
    """An entry of the build's CMake cache."""
    return re.search(rf"^{name}:\w+=(.*)$", (BUILD / "CMakeCache.txt").read_text(), re.M)[1]
