# SPDX-License-Identifier: GPL-3.0-or-later
"""What pip gets: the wheel and the source distribution in environments that have nothing else of ours."""

import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OTHER_TORCH = os.environ.get("ARAPFIELDS_OTHER_TORCH", "2.8.0")  # its wheel is large: 0.9 GB
LEFT_OUT = ("PYTHONPATH", "LD_LIBRARY_PATH", "VIRTUAL_ENV")  # nothing is found by chance
# What the README's lines take for granted: a mesh, and three boxes.
GIVEN = """
import numpy as np
u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 24, endpoint=False), np.linspace(-1, 1, 24), indexing="ij")
V = np.stack([0.3 * np.cos(u), 0.3 * np.sin(u), v], -1).reshape(-1, 3)
i, j = np.meshgrid(np.arange(24), np.arange(23), indexing="ij")
a, b, c, d = (24 * (x % 24) + y for x, y in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)))
F = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
box_a, box_b, moved_box_b = (np.diag([0.4, 0.4, 0.2, 1.0]) for _ in range(3))
box_a[2, 3], box_b[2, 3] = -0.8, 0.8
moved_box_b[:3, 3] = 0.3, 0, 0.8
"""
CHECKED = """
moved = V_deformed - V
assert V_deformed.shape == V.shape and np.abs(moved[V[:, 2] < -0.9]).max() < 0.1
assert np.abs(moved[V[:, 2] > 0.9] - [0.3, 0, 0]).max() < 0.1
print("bent", af.__version__, af.__file__)
"""


def run(*command, code=0, **keywords):
    environment = {key: value for key, value in os.environ.items() if key not in LEFT_OUT}
    command = [str(part) for part in command]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, **keywords)
    assert done.returncode == code, (done.stdout + done.stderr)[-4000:]
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """(wheel, source distribution) as `make wheel` makes them; ARAPFIELDS_DIST names a folder with both."""
    folder = Path(os.environ.get("ARAPFIELDS_DIST", tmp_path_factory.mktemp("dist")))
    if not list(folder.glob("*.whl")):
        run(sys.executable, "-m", "pip", "install", "-q", "-r", ROOT / "wheel_scripts" / "requirements.txt")
        run(sys.executable, ROOT / "wheel_scripts" / "build_wheel.py", "--output", folder, cwd=ROOT)
    (wheel,), (source,) = folder.glob("*cp311*.whl"), folder.glob("*.tar.gz")
    return wheel, source


@pytest.fixture(scope="module")
def environment(built, tmp_path_factory):
    """The Python of an environment in which the wheel alone was asked for."""
    return fresh(tmp_path_factory.mktemp("right"), built[0])


def fresh(folder, *wanted):
    run(sys.executable, "-m", "venv", folder / "venv")
    python = folder / "venv" / "bin" / "python"
    run(python, "-m", "pip", "install", "-q", "--disable-pip-version-check", *wanted)
    return python


def five_lines():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.search(r"## Five lines of Python\n+```python\n(.*?)```", text, flags=re.S)[1]


@pytest.mark.slow
def test_the_five_lines_of_the_readme_run_from_the_wheel(environment, tmp_path):
    said = run(environment, "-c", GIVEN + five_lines() + CHECKED, cwd=tmp_path)
    assert said.startswith(f"bent {PROJECT['version']}") and "site-packages" in said


@pytest.mark.slow
def test_an_editor_finds_the_types(built):
    with zipfile.ZipFile(built[0]) as archive:
        names = archive.namelist()
    assert {"arapfields/py.typed", "arapfields/_native.pyi"} <= set(names)
    assert not [name for name in names if ".libs/" in name or "torch_cpu" in name]


@pytest.mark.slow
def test_metadata_are_those_of_the_project(built):
    with zipfile.ZipFile(built[0]) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        said = Parser().parsestr(archive.read(name).decode())
    assert (said["Name"], said["Version"]) == (PROJECT["name"], PROJECT["version"])
    assert said.get_all("Classifier") == PROJECT["classifiers"]
    assert set(PROJECT["dependencies"]) <= set(said.get_all("Requires-Dist"))
    assert "manylinux_2_28_x86_64" in built[0].name
    run(sys.executable, "-m", "twine", "check", "--strict", *built)


@pytest.mark.slow
def test_another_torch_gets_its_line(built, tmp_path):
    """Beside a torch that it was not built for, as `pip install --no-deps` or a forced version leave it."""
    python = fresh(tmp_path, "--no-deps", built[0], f"torch=={OTHER_TORCH}", "numpy")
    said = run(python, "-c", "import arapfields", code=1, cwd=tmp_path)
    last = said.strip().splitlines()[-1]
    needed = PROJECT["dependencies"][1].partition("==")[2]
    assert last.startswith(
        f"ImportError: arapfields was built against torch {needed}, and torch {OTHER_TORCH}"
    )
    assert last.endswith(f"pip install torch=={needed}, or build arapfields anew")


@pytest.mark.slow
def test_the_source_distribution_builds_by_itself(built, tmp_path):
    """pip fetches compilers' helpers, headers and libtorch from PyPI; a C++ compiler is the system's."""
    with tarfile.open(built[1]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"CMakeLists.txt", "LICENSE", "README.md", "native/options/options.toml", "PKG-INFO"} <= names
    assert not [name for name in names if name.startswith(("addon/", "docs/", "tests/"))]
    python = fresh(tmp_path, built[1])
    run(python, "-c", GIVEN + five_lines() + CHECKED, cwd=tmp_path)
