# SPDX-License-Identifier: GPL-3.0-or-later
"""What packs the extension for Windows, with stand-ins for the wheels that only Windows builds."""

import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "blender_scripts"))
pytest.importorskip("pybind11", reason="pybind11 is not installed")

import windows_extension  # noqa: E402

OPTIONS = (ROOT / "build/wheel/python/arapfields/options.json").read_text(encoding="utf-8")


def wheel_of(folder, python, leave_out=()):
    path = folder / f"arapfields-0.1.0-{python}-{python}-win_amd64.whl"
    contents = {
        f"arapfields/_native.{python}-win_amd64.pyd": python,
        "arapfields/arapfields.dll": python,
        "arapfields/__init__.py": "",
        "arapfields/options.json": OPTIONS,
        "arapfields/libtorch.txt": "2.13.0",
        "arapfields/include/arapfields/types.h": "",
        "arapfields-0.1.0.dist-info/METADATA": "",
    }
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in contents.items():
            if name not in leave_out:
                archive.writestr(name, text)
    return path


def test_the_zip_has_one_library_and_all_bindings(tmp_path):
    wheels = [wheel_of(tmp_path, "cp311"), wheel_of(tmp_path, "cp313")]
    ours, files = windows_extension.merged(wheels, tmp_path / "work")
    assert ours.name == "arapfields-0.1.0-py3-none-win_amd64.whl"
    with zipfile.ZipFile(ours) as archive:
        names = set(archive.namelist())
        assert archive.read("arapfields/arapfields.dll") == b"cp311"
    assert {f"arapfields/_native.{p}-win_amd64.pyd" for p in ("cp311", "cp313")} < names
    # The record of torch's version belongs to a package that finds torch beside itself.
    assert not names & {"arapfields/libtorch.txt", "arapfields/include/arapfields/types.h"}
    polib = tmp_path / "polib-1.2.0-py2.py3-none-any.whl"
    polib.write_bytes(b"")
    path = windows_extension.pack(ours, files["arapfields/options.json"], [polib], tmp_path, tmp_path)
    assert path.name == "arapfields-0.1.0-windows-x64.zip"
    with zipfile.ZipFile(path) as archive:
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        assert archive.read(f"wheels/{ours.name}") == ours.read_bytes()
        assert "guide/index.html" in archive.namelist()
    assert manifest["platforms"] == ["windows-x64"]
    assert sorted(manifest["wheels"]) == [f"./wheels/{ours.name}", f"./wheels/{polib.name}"]


def test_what_is_refused(tmp_path):
    lacking = wheel_of(tmp_path, "cp311", leave_out=("arapfields/arapfields.dll",))
    with pytest.raises(RuntimeError, match=r"lacks arapfields/arapfields\.dll"):
        windows_extension.merged([lacking], tmp_path / "a")
    twice = wheel_of(tmp_path, "cp313")
    with pytest.raises(RuntimeError, match="2 wheels have 1 bindings"):
        windows_extension.merged([twice, twice], tmp_path / "b")
