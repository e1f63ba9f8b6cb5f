# SPDX-License-Identifier: GPL-3.0-or-later
"""What make extension refuses: platforms and Pythons without a binding, zips that lack parts."""

import io
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "blender_scripts"))
pytest.importorskip("pybind11", reason="pybind11 is not installed")

from extension import bindings, check, dependencies  # noqa: E402
from extension.archive import OPTIONS  # noqa: E402

GUIDE = "guide/index.html"
WHEEL = "wheels/arapfields-0.1.0-py3-none-linux_x86_64.whl"
POLIB = "wheels/polib-1.2.0-py2.py3-none-any.whl"
MANIFEST = f'platforms = ["linux-x64"]\nwheels = ["./{WHEEL}", "./{POLIB}"]\n'
PARTS = ["arapfields/libarapfields.so", "arapfields/_native.cpython-311-x86_64-linux-gnu.so"]


def make_zip(path, manifest=MANIFEST, wheel=WHEEL, parts=PARTS, others=(OPTIONS, GUIDE)):
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as inner:
        for part in parts:
            inner.writestr(part, "")
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("__init__.py", "LICENSE", *others):
            archive.writestr(name, "")
        archive.writestr("blender_manifest.toml", manifest)
        archive.writestr(wheel, content.getvalue())
        archive.writestr(POLIB, "")
    return path


def test_a_whole_zip_passes(tmp_path):
    check.check_zip(make_zip(tmp_path / "a.zip"), [(3, 11)])


@pytest.mark.parametrize(
    ("change", "pythons", "text"),
    [
        ({}, [(3, 11), (3, 13)], "no binding for Python 3.13"),
        ({"parts": PARTS[1:]}, [(3, 11)], "0 copies"),
        ({"others": (GUIDE,)}, [(3, 11)], "lacks core/settings/options.json"),
        ({"others": (OPTIONS,)}, [(3, 11)], "lacks guide/index.html"),
        ({"manifest": MANIFEST.replace("linux-x64", "windows-x64")}, [], "declares windows-x64"),
        ({"manifest": 'platforms = ["linux-x64"]\n'}, [], "declares linux-x64, for which no wheel"),
        ({"manifest": MANIFEST.replace(f', "./{POLIB}"', "")}, [], "lacks the wheel of polib"),
        ({"wheel": "wheels/other.whl"}, [], "lacks wheels/arapfields"),
    ],
)
def test_what_is_refused(tmp_path, change, pythons, text):
    with pytest.raises(RuntimeError, match=text):
        check.check_zip(make_zip(tmp_path / "a.zip", **change), pythons)


def test_a_zip_over_the_limit_is_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(check.LIMITS, "linux-x64", 100)
    with pytest.raises(RuntimeError, match="the limit is"):
        check.check_zip(make_zip(tmp_path / "a.zip"), [(3, 11)])


def test_headers_are_known_by_what_they_say(tmp_path):
    folder = tmp_path / "python3.13"
    folder.mkdir()
    (folder / "Python.h").write_text("")
    (folder / "patchlevel.h").write_text(
        "#define PY_MAJOR_VERSION 3\n#define PY_MINOR_VERSION 13\n#define PY_MICRO_VERSION 5\n"
    )
    assert bindings.header_version(folder) == (3, 13, 5)
    assert bindings.header_version(tmp_path) is None
    assert bindings.find_headers([folder])[3, 13] == folder


def test_shipped_packages_are_pinned():
    requirements = (ROOT / "requirements.txt").read_text()
    for name in dependencies.SHIPPED:
        assert dependencies.pinned(requirements, name).startswith(f"{name}==")
    with pytest.raises(RuntimeError, match="does not pin a version of polib"):
        dependencies.pinned("polib>=1\n", "polib")
