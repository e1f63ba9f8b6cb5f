# SPDX-License-Identifier: GPL-3.0-or-later
"""The binding module for every Python whose headers are at hand, built against one libarapfields."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pybind11

SERVED = [(3, 11), (3, 13), (3, 14)]  # Pythons of the Blenders that the manifest admits
AS_THE_LIBRARY = [  # of its CMake cache; the last three link for an older glibc (cmake/wheel/old_glibc.py)
    "CMAKE_CXX_COMPILER",
    "CMAKE_CXX_COMPILER_LAUNCHER",
    "CMAKE_MAKE_PROGRAM",
    "CMAKE_CXX_STANDARD_LIBRARIES",
    "CMAKE_MODULE_LINKER_FLAGS",
    "CMAKE_SHARED_LINKER_FLAGS",
]
ROOT = Path(__file__).resolve().parents[2]
SEARCHED = [
    str(ROOT / "build/python-headers/*/usr/include"),  # python_headers.py
    "/usr/include",
    "/usr/local/include",
    "/opt/python/*/include",  # the manylinux containers
    "/opt/*/usr/include",  # a chroot with another release's headers
    str(Path.home() / ".pyenv/versions/*/include"),
]


def header_version(folder):
    """(major, minor, micro) that the Python.h in `folder` belongs to, or None."""
    patchlevel = Path(folder) / "patchlevel.h"
    if not (Path(folder) / "Python.h").exists() or not patchlevel.exists():
        return None
    parts = re.findall(r"#define PY_(?:MAJOR|MINOR|MICRO)_VERSION\s+(\d+)", patchlevel.read_text())
    return tuple(map(int, parts))


def find_headers(given=()):
    """{(3, 11): folder, …}: the headers at hand; those `given` come first."""
    candidates = [Path(folder) for folder in given]
    for pattern in SEARCHED:
        candidates += sorted(Path("/").glob(pattern.lstrip("/") + "/python3.*"))
    found = {}
    for folder in candidates:
        version = header_version(folder)
        if version and version[:2] in SERVED:
            found.setdefault(version[:2], folder)
    return dict(sorted(found.items()))


def module_name(version):
    return f"_native.cpython-{version[0]}{version[1]}-x86_64-linux-gnu.so"


def cached(build, name):
    """An entry of the CMake cache of the build folder."""
    match = re.search(rf"^{name}:\w+=(.*)$", (build / "CMakeCache.txt").read_text(), flags=re.M)
    return match.group(1) if match else ""


def build_binding(root, build, headers, version, work):
    """Compiles the binding module alone for the Python with these `headers`; returns its path."""
    folder = work / f"binding-{version[0]}.{version[1]}"
    cmake = Path(sys.executable).parent / "cmake"
    cmake = str(cmake) if cmake.exists() else "cmake"
    configure = [cmake, "-S", str(root), "-B", str(folder), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release"]
    configure += [
        f"-DARAPFIELDS_BINDING_HEADERS={headers}",
        f"-DARAPFIELDS_BINDING_NAME={module_name(version)}",
        f"-DARAPFIELDS_LIBRARY={build / 'python/arapfields/libarapfields.so'}",
        f"-DARAPFIELDS_GENERATED={build / 'generated'}",
        f"-DEIGEN_INCLUDE_DIR={cached(build, 'EIGEN_INCLUDE_DIR')}",
        f"-DPYBIND11_INCLUDE_DIR={pybind11.get_include()}",
    ]
    configure += [f"-D{name}={cached(build, name)}" for name in AS_THE_LIBRARY if cached(build, name)]
    for command in (configure, [cmake, "--build", str(folder)]):
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            log = (done.stdout + done.stderr)[-4000:]
            raise RuntimeError(f"the binding for Python {version[0]}.{version[1]} does not build:\n{log}")
    return folder / module_name(version)


def gather_bindings(root, build, headers, work, output):
    """Bindings for all `headers` in `output`: the build's own where it has one, else compiled here."""
    paths = []
    for version, folder in headers.items():
        name = module_name(version)
        ready = build / "python/arapfields" / name
        source = ready if ready.exists() else build_binding(root, build, folder, version, work)
        shutil.copyfile(source, output / name)
        (output / name).chmod(0o755)
        paths.append(output / name)
    return paths
