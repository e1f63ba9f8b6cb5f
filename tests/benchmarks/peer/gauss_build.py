# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiles the Python module of ugogon/gaussStylization against the Eigen and pybind11 of .venv."""

import subprocess
import sys
import sysconfig
from pathlib import Path

from .theirs import KEPT, Refused, commit


def built(checkout):
    """The folder of gauss_stylization.so, compiled if it is not there for this commit."""
    import pybind11

    folder = KEPT / f"gauss-{commit(checkout).replace(' ', '-')}"
    module = folder / "gauss_stylization.so"
    if module.exists():
        return folder
    folder.mkdir(parents=True, exist_ok=True)
    headers = [checkout / name for name in ("libigl/include", "utils_gauss", "utils_cubic")]
    headers += [Path(sys.prefix) / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}"]
    headers[-1] /= "site-packages/cmeel.prefix/include/eigen3"
    headers += [pybind11.get_include(), sysconfig.get_paths()["include"]]
    flags = ["-std=c++17", "-O3", "-DNDEBUG", "-w", "-fPIC", *(f"-I{path}" for path in headers)]
    sources = [checkout / "gaussStylization_python" / "main.cpp"]
    sources += [
        path for name in ("utils_gauss", "utils_cubic") for path in sorted((checkout / name).glob("*.cpp"))
    ]
    objects = []
    for source in sources:
        objects.append(folder / f"{source.stem}.o")
        run(["c++", *flags, "-c", source, "-o", objects[-1]])
    run(["c++", "-shared", *objects, "-o", module])
    return folder


def run(command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode:
        raise Refused(f"does not compile: {done.stderr.strip().splitlines()[-1][:200]}")
