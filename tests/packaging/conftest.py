# SPDX-License-Identifier: GPL-3.0-or-later
"""The packages of a release, and an environment with the wheel."""

import os
import sys
from pathlib import Path

import pytest
from support.programs.environments import BUILD, CMAKE, ROOT, fresh, run


@pytest.fixture(scope="session")
def built(tmp_path_factory):
    """(wheel, source distribution), from the folder ARAPFIELDS_DIST or built as `make release` does."""
    folder = Path(os.environ.get("ARAPFIELDS_DIST", tmp_path_factory.mktemp("dist")))
    if not list(folder.glob("*.whl")):
        run(sys.executable, "-m", "pip", "install", "-q", "-r", ROOT / "cmake" / "wheel" / "requirements.txt")
        run(sys.executable, ROOT / "cmake" / "wheel" / "build_wheels.py", "linux-x64", "--output", folder)
        run(sys.executable, ROOT / "cmake" / "wheel" / "release.py", "--output", folder)
    (wheel,), (source,) = folder.glob("*cp311*manylinux*x86_64.whl"), folder.glob("*.tar.gz")
    return wheel.resolve(), source.resolve()


@pytest.fixture(scope="session")
def environment(built, tmp_path_factory):
    """The Python of an environment in which only the wheel was installed."""
    return fresh(tmp_path_factory.mktemp("right"), built[0])


@pytest.fixture(scope="module")
def prefix(tmp_path_factory):
    """The folder of `cmake --install`."""
    folder = tmp_path_factory.mktemp("prefix")
    run(CMAKE, "--install", BUILD, "--prefix", folder)
    return folder
