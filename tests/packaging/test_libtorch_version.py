# SPDX-License-Identifier: GPL-3.0-or-later
"""Importing the package beside a torch that it was not built against: one line instead of a crash."""

import importlib.util
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

import arapfields

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
