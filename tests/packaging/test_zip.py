# SPDX-License-Identifier: GPL-3.0-or-later
"""The zips of the extension: their contents, their guide, and an archive of the sources."""

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from support.blender.inside import require_bpy

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "blender_scripts"), str(ROOT / "cmake/wheel")]

import build_extension  # noqa: E402
import python_headers  # noqa: E402
from platforms import BLENDERS, PLATFORMS, PYTHONS, declared  # noqa: E402

# What make extension and make wheels refuse: parts that lack, wheels that were changed, foreign needs.

LINUX, MACS = PLATFORMS["linux-x64"], PLATFORMS["macos-arm64"]


@pytest.fixture
def wheels(tmp_path):
    paths = [
        tmp_path / f"arapfields-0.1.0-{MACS.wheel_tags(pythons)}.whl" for pythons in MACS.extension_wheels
    ]
    for path in paths:
        with zipfile.ZipFile(path, "w") as wheel:
            wheel.writestr("arapfields/options.json", path.name)
    return paths


def written(folder, wheels, guide=("guide/index.html",)):
    path, addon = folder / "a.zip", folder / "addon"
    addon.mkdir(exist_ok=True)
    (addon / "__init__.py").touch()
    (addon / "blender_manifest.toml").write_bytes((ROOT / "addon/blender_manifest.toml").read_bytes())
    build_extension.write_extension(addon, wheels, "", dict.fromkeys(guide, ""), path, "linux-arm64")
    return path


def test_a_complete_zip_passes_and_names_its_platform(wheels, tmp_path):
    path = written(tmp_path, wheels)
    build_extension.check_zip(path, wheels)
    with zipfile.ZipFile(path) as content:
        manifest = content.read("blender_manifest.toml").decode()
    assert 'platforms = ["linux-arm64"]' in manifest and "(not yet run)" in manifest


def test_incomplete_zips_are_refused(wheels, tmp_path, monkeypatch):
    with pytest.raises(RuntimeError, match="lacks guide/index"):
        build_extension.check_zip(written(tmp_path, wheels, ()), wheels)
    with pytest.raises(RuntimeError, match=r"lacks wheels/arapfields.*cp314"):
        build_extension.check_zip(written(tmp_path, wheels[:2]), wheels)
    with pytest.raises(RuntimeError, match="other wheels"):
        build_extension.check_zip(written(tmp_path, wheels), wheels[:2])
    path = written(tmp_path, wheels)
    monkeypatch.setattr(build_extension, "LIMIT", 100)
    with pytest.raises(RuntimeError, match="the limit is"):
        build_extension.check_zip(path, wheels)
    wheels[1].write_bytes(b"another")
    with pytest.raises(RuntimeError, match=r"another arapfields.*cp313"):
        build_extension.check_zip(path, wheels)
    wheels[2].unlink()
    with pytest.raises(RuntimeError, match=r"lacks arapfields-0.1.0-cp314-cp314-mac.*PLATFORM=macos-arm64"):
        build_extension.own_wheels(MACS, tmp_path, "0.1.0")
    with pytest.raises(
        RuntimeError, match=r"lacks arapfields-0.1.0-cp311\.cp313\.cp314-cp311.*PLATFORM=linux-x64"
    ):
        build_extension.own_wheels(LINUX, tmp_path, "0.1.0")


def test_a_python_without_headers_is_left_out_unless_blender_has_it(monkeypatch, capsys):
    """Debian has no Python 3.12: the zips are built without it, a release is not."""

    def lacking(missing):
        def headers(version):
            if version == missing:
                raise RuntimeError("no headers of Python {}.{}".format(*version))

        return headers

    monkeypatch.setattr(python_headers, "headers", lacking((3, 12)))
    assert python_headers.pythons(False) == BLENDERS
    assert "left out: no headers of Python 3.12" in capsys.readouterr().out
    with pytest.raises(RuntimeError, match=r"3\.12"):
        python_headers.pythons(True)
    monkeypatch.setattr(python_headers, "headers", lacking((3, 13)))
    with pytest.raises(RuntimeError, match=r"3\.13"):
        python_headers.pythons(False)


def test_headers_that_nobody_has_are_refused(monkeypatch):
    monkeypatch.setattr(python_headers, "at_hand", lambda version: None)
    with pytest.raises(RuntimeError, match=r"needs python3\.12 in PATH"):
        python_headers.headers((3, 12))


ASKED = """
extern int deflate(void *, int);
extern int clock_nanosleep(int, int, const void *, void *);
int PyInit__native(void) { return deflate(0, 0) + clock_nanosleep(0, 0, 0, 0); }
"""


def test_a_wheel_that_asks_for_more_than_the_system_has_is_refused(tmp_path):
    """A module that links with zlib, without kernels, in a wheel that depends on torch."""
    check_wheel = pytest.importorskip("check_wheel", reason="lief is not installed (make wheels)")
    (tmp_path / "a.c").write_text(ASKED)
    name, path = (
        "_native.cpython-311-x86_64-linux-gnu.so",
        tmp_path / f"arapfields-0.1.0-cp311-cp311-{LINUX.tag}.whl",
    )
    subprocess.run(
        ["cc", "-shared", "-fPIC", "a.c", "-Wl,--no-as-needed", "-l:libutil.so.1", "-o", name],
        cwd=tmp_path,
        check=True,
    )
    with zipfile.ZipFile(path, "w") as wheel:
        for file in (name, "libtorch_cpu.so"):
            wheel.write(tmp_path / name, f"arapfields/{file}")
        wheel.writestr("arapfields-0.1.0.dist-info/METADATA", "Requires-Dist: torch\n")
    said = "\n".join(check_wheel.problems([path]))
    for problem in (
        *(
            "lacks libarapfields.so",
            "carries libtorch_cpu.so",
            "depends on torch",
            "lacks kernels for avx512",
        ),
        *("asks for libutil", "asks for deflate, which nobody has"),
    ):
        assert problem in said, said


@pytest.mark.parametrize("version", PYTHONS, ids=str)
def test_pyconfig_defines_the_macros_of_the_headers(version):
    """Of the names that this system's own pyconfig.h defines."""
    folder = python_headers.at_hand(version)
    if folder is None:
        pytest.skip("no headers of that Python")
    beside = [*folder.parent.glob(f"*-linux-gnu/{folder.name}/pyconfig.h"), folder / "pyconfig.h"]
    known = set(re.findall(r"^#define (\w+)", beside[0].read_text(), flags=re.M))
    answered = set(re.findall(r"#define (\w+)", (ROOT / "cmake/wheel/pyconfig.h").read_text()))
    asked = set()
    for path in folder.rglob("*.h"):
        text = path.read_text(errors="replace")
        if "internal" not in path.parts and path.name not in ("pyconfig.h", "py_curses.h"):
            lines = re.findall(r"^[ \t]*#[ \t]*(?:if|ifdef|ifndef|elif)\b((?:.*\\\n)*.*)", text, flags=re.M)
            asked |= {word for line in lines for word in re.findall(r"\b[A-Za-z_]\w+", line)}
            asked |= set(re.findall(r"\b(?:SIZEOF|ALIGNOF)_\w+", text))
    assert asked & known - answered <= {"WITH_DTRACE", "_XOPEN_SOURCE_EXTENDED"}
    assert {"PyLong_FromLong": "FUNC", "PyLong_Type": "DATA"}.items() <= declared(folder).items()


@pytest.mark.slow
def test_a_library_for_macs_that_was_changed_after_signing_is_refused(tmp_path):
    check_wheel = pytest.importorskip("check_wheel", reason="lief is not installed (make wheels)")
    (tmp_path / "a.c").write_text("int PyInit__native(void) { return 3; }\n")
    command = [sys.executable, "-m", "ziglang", "cc", "-target", PLATFORMS["macos-arm64"].target, "-shared"]
    subprocess.run([*command, "a.c", "-o", "a.so"], cwd=tmp_path, check=True)
    data = bytearray((tmp_path / "a.so").read_bytes())
    image = check_wheel.lief.parse(list(data))
    assert check_wheel.signature_problem(data, image) == ""
    data[100] ^= 1
    assert check_wheel.signature_problem(data, image) == "was changed after it was signed"


# Who installs the source code by mistake reads what to install instead.

WITHOUT_LIBRARY = """
import sys


class Nowhere:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == "arapfields":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


import importlib.util, bpy
real = importlib.util.find_spec
importlib.util.find_spec = lambda name, package=None: None if name == "arapfields" else real(name, package)
sys.meta_path.insert(0, Nowhere)
print(bpy.ops.extensions.package_install_files(
    filepath=sys.argv[1], repo="user_default", enable_on_install=True))
bpy.ops.mesh.primitive_cube_add()
try:
    bpy.ops.arapfields.stylize()
except RuntimeError as error:
    print("OPERATOR", error)
from bl_ext.user_default.arapfields.commands.main import run
print("COMMAND", run(["stylize", "--style", "cube", "-i", "a.ply", "-o", "b.ply"]))
"""


def test_it_is_enabled_and_says_so(tmp_path):
    require_bpy()
    path = tmp_path / "arapfields-main.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for file in (ROOT / "addon").rglob("*"):
            if file.is_file() and "__pycache__" not in file.parts:
                archive.write(file, Path("arapfields-main") / file.relative_to(ROOT))
        archive.write(ROOT / "README.md", "arapfields-main/README.md")
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_LIBRARY, str(path)],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "user"), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0 and "{'FINISHED'}" in done.stdout, done.stdout + done.stderr
    advice = (
        "The native library is not part of this installation. Install arapfields-<version>-<platform>.zip"
    )
    assert f"ARAP Fields: {advice}" in done.stderr  # at once
    assert advice in done.stdout[done.stdout.index("OPERATOR") :]
    assert "COMMAND 2" in done.stdout and f"arapfields: {advice}" in done.stderr


# The guide in the extension's zip: every page and picture that Blender's right click may open.


@pytest.fixture(scope="module")
def files():
    return build_extension.guide_files(ROOT / "docs")


def test_every_guide_page_ships_and_its_links_resolve(files):
    pages = {name for name in files if name.endswith(".html")}
    assert pages == {f"guide/{page.stem}.html" for page in (ROOT / "docs/guide").glob("*.md")}
    for name in pages:
        html = files[name].decode()
        assert "<h1" in html and "<!-- settings" not in html
        anchors = {
            page: set(re.findall(r'id="([^"]+)"', content.decode()))
            for page, content in files.items()
            if page in pages
        }
        for target in re.findall(r'(?:href|src)="([^"]+)"', html):
            path, _, anchor = target.partition("#")
            there = f"guide/{path}" if path else name
            assert there in files, (name, target)
            assert anchor in {"", *anchors.get(there, ())}, (name, target)


def test_pages_named_by_tooltips_exist(files):
    source = (ROOT / "addon/blender/source_operator.py").read_text()
    named = set(re.findall(r'"(?:ARAPFIELDS_PG_\w+)": "(\w+)"', source))
    assert len(named) > 3 and {f"guide/{page}.html" for page in named} <= {*files}
