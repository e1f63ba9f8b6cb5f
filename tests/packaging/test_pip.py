# SPDX-License-Identifier: GPL-3.0-or-later
"""What pip gets: wheel and source distribution in clean environments, and beside another torch."""

import importlib.util
import json
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email.parser import Parser
from importlib import metadata
from pathlib import Path

import pytest
from support.programs.environments import fresh, python_of, run

import arapfields

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "cmake/wheel"))

import release  # noqa: E402
from platforms import PYTHONS  # noqa: E402

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
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
import importlib.util
assert importlib.util.find_spec("torch") is None
print("bent", af.__version__, af.__file__)
"""


def five_lines():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.search(r"## Five lines of Python\n+```python\n(.*?)```", text, flags=re.S)[1]


def notebook():
    """The code of the notebook, as one script."""
    cells = json.loads((ROOT / "docs/examples/pose.ipynb").read_text(encoding="utf-8"))["cells"]
    return "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")


@pytest.mark.slow
@pytest.mark.parametrize("version", PYTHONS, ids="{0[0]}.{0[1]}".format)
def test_the_five_lines_of_the_readme_and_the_notebook_run_from_the_wheel(built, version, tmp_path):
    """In an environment of each Python with the wheel that pip chooses for it."""
    program = python_of(version)
    if program is None:
        pytest.skip("no such Python on this system")
    chosen = (
        "--find-links",
        built[0].parent,
        "--only-binary",
        "arapfields",
        f"arapfields=={PROJECT['version']}",
    )
    python = fresh(tmp_path, *chosen, python=program)
    said = run(python, "-c", GIVEN + five_lines() + CHECKED, cwd=tmp_path)
    assert said.startswith(f"bent {PROJECT['version']}") and "site-packages" in said
    run(python, "-m", "pip", "install", "-q", "--disable-pip-version-check", "matplotlib")
    run(python, "-c", notebook(), cwd=tmp_path)
    assert (tmp_path / "posed.png").stat().st_size > 10_000


def test_the_pythons_of_wheels_are_those_that_are_declared():
    declared = [name.rpartition(" ")[2] for name in PROJECT["classifiers"] if " :: 3." in name]
    assert declared == ["{}.{}".format(*version) for version in PYTHONS]


@pytest.mark.slow
def test_wheel_metadata_equal_the_project_s(built):
    with zipfile.ZipFile(built[0]) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        said = Parser().parsestr(archive.read(name).decode())
    assert (said["Name"], said["Version"]) == (PROJECT["name"], PROJECT["version"])
    assert said.get_all("Classifier") == PROJECT["classifiers"]
    assert set(PROJECT["dependencies"]) <= set(said.get_all("Requires-Dist"))


def in_source(path):
    """What the source distribution holds, as paths from its top."""
    with tarfile.open(path) as archive:
        return {name.partition("/")[2] for name in archive.getnames()}


def known(*folders):
    """Files that git knows."""
    done = subprocess.run(["git", "ls-files", *folders], cwd=ROOT, capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines())


def test_the_source_distribution_contains_only_build_files(tmp_path):
    top = {"CHANGELOG.md", "CMakeLists.txt", "LICENSE", "README.md", "pyproject.toml", "PKG-INFO"}
    top |= {"CITATION.cff", "THIRD_PARTY.txt"}
    cmake = {name for name in known("cmake") if not re.search(r"/wheel/|mingw", name)}
    assert in_source(release.build_sdist(tmp_path)) == top | cmake | known("native")


@pytest.mark.slow
def test_the_source_distribution_builds_by_itself(built, tmp_path):
    """pip fetches compilers' helpers and headers from PyPI; a C++ compiler is the system's."""
    python = fresh(tmp_path, built[1])
    run(python, "-c", GIVEN + five_lines() + CHECKED, cwd=tmp_path)


def test_warnings_are_errors_only_in_our_builds():
    """Compilers that we have not seen may warn of more."""
    listed = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    assert re.search(r'option\(ARAPFIELDS_WERROR "[^"]*" OFF\)', listed)
    ours = json.loads((ROOT / "build" / "wheel" / "compile_commands.json").read_text(encoding="utf-8"))
    assert ours and all(" -Werror " in one["command"] for one in ours)


# Importing the package beside a torch that it was not built against: one line instead of a crash.

PACKAGE = Path(arapfields.__file__).parent
BUILT_AGAINST = metadata.version("torch").partition("+")[0]


@pytest.fixture
def check():
    """The module's function, loaded alone."""
    spec = importlib.util.spec_from_file_location("alone", PACKAGE / "_libtorch.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.check


def beside(folder, built_against):
    folder.mkdir(exist_ok=True)
    (folder / "libtorch.txt").write_text(built_against + "\n")
    return folder


def test_the_package_records_its_libtorch_version(check):
    assert (PACKAGE / "libtorch.txt").read_text().strip() == BUILT_AGAINST
    check()


def test_another_version_is_named(check, tmp_path):
    with pytest.raises(ImportError, match=re.escape(BUILT_AGAINST)) as caught:
        check(beside(tmp_path, "2.8.0"))
    assert "2.8.0" in str(caught.value) and "\n" not in str(caught.value)


def test_a_missing_torch_is_named(check, tmp_path, monkeypatch):
    def nowhere(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", nowhere)
    with pytest.raises(ImportError, match=r"not installed: pip install torch==2\.8\.0"):
        check(beside(tmp_path, "2.8.0"))


def test_import_ends_with_that_line(tmp_path):
    """In a process of its own: the package as it is, beside the record of another torch."""
    for other in PACKAGE.iterdir():
        if other.name not in ("libtorch.txt", "__pycache__"):
            link = tmp_path / "arapfields" / other.name
            link.parent.mkdir(exist_ok=True)
            link.symlink_to(other)
    beside(tmp_path / "arapfields", "2.8.0")
    build = subprocess.run(
        [sys.executable, "-c", "import arapfields"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={"PYTHONPATH": str(tmp_path)},
    )
    assert build.returncode == 1
    last = build.stderr.strip().splitlines()[-1]
    assert last.startswith("ImportError: arapfields was built against torch 2.8.0") and BUILT_AGAINST in last
