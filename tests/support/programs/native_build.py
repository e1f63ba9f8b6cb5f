# SPDX-License-Identifier: GPL-3.0-or-later
"""The tested build, and its files installed by CMake."""

import os
import re
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
NATIVE = ROOT / "native"
BUILD = ROOT / "build" / "wheel"
CMAKE = shutil.which("cmake", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
PUBLIC = sorted((NATIVE / "include" / "arapfields").glob("*.h"))


def cached(name):
    """An entry of the build's CMake cache."""
    return re.search(rf"^{name}:\w+=(.*)$", (BUILD / "CMakeCache.txt").read_text(), re.M)[1]
