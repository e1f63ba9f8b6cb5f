# SPDX-License-Identifier: GPL-3.0-or-later
"""What make extension and make wheels refuse: parts that lack, wheels that were changed, foreign needs."""

import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "blender_scripts"), str(ROOT / "cmake/wheel")]

import build_extension  # noqa: E402
import python_headers  # noqa: E402
from extension import archive, check  # noqa: E402
from platforms import PLATFORMS, PYTHONS, declared  # noqa: E402

LINUX, MACS = PLATFORMS["linux-x64"], PLATFORMS["macos-arm64"]


@pytest.fixture
def wheels(tmp_path):
    paths = [tmp_path / f"arapfields-0.1.0-{MACS.wheel_tags(pythons)}.whl" for pythons in MACS.wheels]
    for path in paths:
        with zipfile.ZipFile(path, "w") as wheel:
            wheel.writestr("arapfields/options.json", path.name)
    return paths


def written(folder, wheels, guide=("guide/index.html",)):
    path, addon = folder / "a.zip", folder / "addon"
    addon.mkdir(exist_ok=True)
    (addon / "__init__.py").touch()
    (addon / "blender_manifest.toml").write_bytes((ROOT / "addon/blender_manifest.toml").read_bytes())
    archive.write_extension(addon, wheels, "", dict.fromkeys(guide, ""), path, "linux-arm64")
    return path


def test_a_whole_zip_passes_and_says_whom_it_is_for(wheels, tmp_path):
    path = written(tmp_path, wheels)
    check.check_zip(path, wheels)
    with zipfile.ZipFile(path) as content:
        manifest = content.read("blender_manifest.toml").decode()
    assert 'platforms = ["linux-arm64"]' in manifest and "(not yet run)" in manifest


def test_what_is_refused(wheels, tmp_path, monkeypatch):
    with pytest.raises(RuntimeError, match="lacks guide/index"):
        check.check_zip(written(tmp_path, wheels, ()), wheels)
    with pytest.raises(RuntimeError, match=r"lacks wheels/arapfields.*cp314"):
        check.check_zip(written(tmp_path, wheels[:2]), wheels)
    with pytest.raises(RuntimeError, match="other wheels"):
        check.check_zip(written(tmp_path, wheels), wheels[:2])
    path = written(tmp_path, wheels)
    monkeypatch.setattr(check, "LIMIT", 100)
    with pytest.raises(RuntimeError, match="the limit is"):
        check.check_zip(path, wheels)
    wheels[1].write_bytes(b"another")
    with pytest.raises(RuntimeError, match=r"another arapfields.*cp313"):
        check.check_zip(path, wheels)
    wheels[2].unlink()
    with pytest.raises(RuntimeError, match=r"lacks arapfields-0.1.0-cp314-cp314-mac.*PLATFORM=macos-arm64"):
        build_extension.own_wheels(MACS, tmp_path, "0.1.0")
    with pytest.raises(
        RuntimeError, match=r"lacks arapfields-0.1.0-cp311\.cp313\.cp314-cp311.*PLATFORM=linux-x64"
    ):
        build_extension.own_wheels(LINUX, tmp_path, "0.1.0")


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
def test_pyconfig_answers_what_the_headers_ask(version):
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
