# SPDX-License-Identifier: GPL-3.0-or-later
"""macOS's libraries, edited and signed on Linux: a small file made here, and the zip where it was built."""

import os
import re
import shutil
import struct
import subprocess
import sys
from itertools import accumulate
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "blender_scripts"))
pytest.importorskip("pybind11", reason="pybind11 is not installed")

from extension import archive, bindings, macho, macho_sign, macos_check, macos_headers, macos_tools  # noqa: E402

ROOM, CODE, TABLES = 1024, 20000, 512
OTHERS = "@rpath/libtorch_cpu.dylib"


def dylib_command(kind, name):
    text = name.encode() + b"\0"
    size = -(-(24 + len(text)) // 8) * 8
    return struct.pack("<6I", kind, size, 24, 2, 0x10000, 0x10000) + text.ljust(size - 24, b"\0")


def segment_command(name, offset, size, sections=b""):
    padded, length = name.encode().ljust(16, b"\0"), 72 + len(sections)
    kinds = (5, 5, len(sections) // 80, 0)
    places = (offset, 1 << 15, offset, size)
    return struct.pack("<II16s4Q4I", macho.SEGMENT, length, padded, *places, *kinds) + sections


def symbol_tables(start):
    """One function of ours, one asked of the second library, with their names; and the command that tells."""
    names = b"\0_ours\0_theirs\0"
    entries = struct.pack("<IBBHQ", 1, 0xF, 1, 0, ROOM) + struct.pack("<IBBHQ", 7, 0x1, 0, 2 << 8, 0)
    trie = b"\0\1_ours\0\x09" + bytes([3, 0, 0x80 | ROOM & 0x7F, ROOM >> 7]) + b"\0"  # one edge, then its end
    data = entries + names.ljust(16, b"\0") + trie
    commands = struct.pack("<6I", macho.SYMTAB, 24, start, 2, start + 32, 16)
    commands += struct.pack("<4I", macho.EXPORTS_TRIE, 16, start + 48, len(trie))
    return data.ljust(TABLES, b"\0"), commands


def write_library(path, system=(14, 0), cpu=macho.ARM64):
    """A library of the least that the format asks for, not signed yet."""
    section = struct.pack("<16s16sQQ8I", b"__text", b"__TEXT", ROOM, CODE, ROOM, 2, 0, 0, 0, 0, 0, 0)
    end = ROOM + CODE
    tables, told = symbol_tables(end)
    commands = segment_command("__TEXT", 0, end, section) + segment_command("__LINKEDIT", end, TABLES)
    commands += dylib_command(macho.ID_DYLIB, "/opt/libthis.dylib")
    commands += dylib_command(macho.LOAD_DYLIB, macos_check.SYSTEM_LIBRARY)
    commands += dylib_command(macho.LOAD_DYLIB, OTHERS) + told
    commands += struct.pack("<6I", macho.BUILD_VERSION, 24, 1, system[0] << 16 | system[1] << 8, 0, 0)
    commands += struct.pack("<3I", macho.RPATH, 24, 12) + b"/nowhere\0\0\0\0"
    header = struct.pack("<8I", macho.MAGIC, cpu, 0, 6, 9, len(commands), 0, 0)
    code = bytes(i * 7 % 251 for i in range(CODE))
    path.write_bytes((header + commands).ljust(ROOM, b"\0") + code + tables)
    return path


@pytest.fixture
def signed(tmp_path):
    path = write_library(tmp_path / "libthis.dylib")
    macho.rename(path, "@loader_path/libthis.dylib", {OTHERS: "@loader_path/libarapfields-torch_cpu.dylib"})
    macho_sign.sign(path, "libthis")
    return path


def test_names_change_and_the_rest_stays(tmp_path, signed):
    before, after = macho.read(write_library(tmp_path / "before.dylib")), macho.read(signed)
    assert macho.rpaths(before) == ["/nowhere"] and macho.rpaths(after) == []
    assert macho.install_name(after) == "@loader_path/libthis.dylib"
    assert macho.loaded(after) == [macos_check.SYSTEM_LIBRARY, "@loader_path/libarapfields-torch_cpu.dylib"]
    assert macho.undefined_symbols(after) == [("_theirs", "@loader_path/libarapfields-torch_cpu.dylib")]
    assert macho.exports(after, "_ours") and not macho.exports(after, "_our")
    assert not macho.exports(after, "_ours2") and not macho.exports(after, "_theirs")
    assert after.data[ROOM : ROOM + CODE] == before.data[ROOM : ROOM + CODE]
    _, _, offset, size = macho.segments(after)["__LINKEDIT"]
    assert offset + size == len(after.data)


def test_a_signature_holds_every_byte(signed):
    pages = macho_sign.check_signature(signed)
    assert pages == -(-(ROOM + CODE + TABLES) // 4096)
    whole = signed.read_bytes()
    for place in (40, ROOM + 5, ROOM + CODE + 40):
        signed.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        with pytest.raises(RuntimeError, match=r"1 of \d+ pages|damaged|no section"):
            macho_sign.check_signature(signed)
    signed.write_bytes(whole + b"\0")
    with pytest.raises(RuntimeError, match="does not end where the file does"):
        macho_sign.check_signature(signed)
    signed.write_bytes(whole)
    with pytest.raises(RuntimeError, match="signed already"):
        macho_sign.sign(signed, "again")


def test_what_is_not_signed_or_has_no_room(tmp_path):
    path = write_library(tmp_path / "libthis.dylib")
    with pytest.raises(RuntimeError, match="not signed"):
        macho_sign.check_signature(path)
    with pytest.raises(RuntimeError, match="no room for longer names"):
        macho.rename(path, "@loader_path/" + "x" * ROOM, {})
    path.write_bytes(b"\x7fELF" * 16)
    with pytest.raises(RuntimeError, match="no 64-bit Mach-O"):
        macho.read(path)


@pytest.mark.parametrize(
    ("change", "names", "text"),
    [
        ({}, (), "which does not ship"),
        ({"cpu": 0x01000007}, ("libarapfields-torch_cpu.dylib",), "another processor"),
        ({"system": (15, 2)}, ("libarapfields-torch_cpu.dylib",), r"needs macOS \(15, 2\)"),
    ],
)
def test_files_that_could_not_be_loaded(tmp_path, change, names, text):
    path = write_library(tmp_path / "libthis.dylib", **change)
    macho.rename(path, "@loader_path/libthis.dylib", {OTHERS: "@loader_path/libarapfields-torch_cpu.dylib"})
    macho_sign.sign(path, "libthis")
    with pytest.raises(RuntimeError, match=text):
        macos_check.check_file(path, names)


def test_pyconfig_answers_what_the_headers_ask_and_nothing_else(tmp_path):
    folder = tmp_path / "python3.13"
    folder.mkdir()
    (folder / "pyconfig.h").write_text(
        "#define SIZEOF_LONG_DOUBLE 16\n#define HAVE_EPOLL 1\n#define HAVE_ODD 1\n"
    )
    (folder / "Python.h").write_text("#if SIZEOF_LONG_DOUBLE > 8\n#endif\n")
    text = macos_headers.macos_config(folder)
    assert "#define SIZEOF_LONG_DOUBLE __SIZEOF_LONG_DOUBLE__" in text and "EPOLL" not in text
    (folder / "Python.h").write_text("#ifdef HAVE_ODD\n#endif\n")
    with pytest.raises(RuntimeError, match="not known to have HAVE_ODD"):
        macos_headers.macos_config(folder)


def test_sizes_of_matrices_are_compared_as_one_type():
    """Eigen's sizes are long, ours int64_t: on a Mac two types, which std::min and std::max do not take."""
    compared = re.compile(r"std::(?:min|max)\((?=[^;]*?\.(?:rows|cols)\(\))([^;{]*)")
    sources = [path for path in (ROOT / "native").rglob("*.*") if path.suffix in (".cpp", ".h")]
    assert sources
    for path in sorted(sources):
        for match in compared.finditer(path.read_text(encoding="utf-8")):
            depths = list(accumulate((c == "(") - (c == ")") for c in match[1]))
            given = match[1][: depths.index(-1)] if -1 in depths else match[1]
            assert not re.search(r"\.(rows|cols)\(\)", given), f"{path}: std::min<Index>({given})"


def test_the_manifest_says_that_it_was_not_run():
    text = (ROOT / "addon/blender_manifest.toml").read_text()
    mac, linux = archive.platform_manifest(text, "macos-arm64"), archive.platform_manifest(text, "linux-x64")
    assert linux == text
    assert 'platforms = ["macos-arm64"]' in mac and "not yet run" in mac
    (tagline,) = [line for line in mac.splitlines() if line.startswith("tagline")]
    assert len(tagline.split('"')[1]) <= 64  # Blender's limit


@pytest.fixture(scope="session")
def built(tmp_path_factory):
    """The zip that make extension PLATFORM=macos-arm64 left, and its libraries."""
    zips = sorted((ROOT / "dist").glob("*-macos-arm64.zip"))
    given = os.environ.get("ARAPFIELDS_MACOS_EXTENSION")
    if not given and not zips:
        pytest.skip("no zip for macOS is built")
    pytest.importorskip("ziglang", reason="ziglang, which lists libSystem's symbols, is not installed")
    path = Path(given) if given else zips[-1]
    return path, macos_check.native_files(path, tmp_path_factory.mktemp("macos"))[0]


def test_the_built_zip_holds_what_is_said_of_it(built):
    path, files = built
    lines = macos_check.report(path, bindings.find_headers())
    assert path.stat().st_size < 200e6
    assert len([line for line in lines if "arm64, macOS 14" in line or "arm64, macOS 11" in line]) == len(
        files
    )
    assert any(name.startswith("_native.cpython-311-darwin") for name in files)


def test_the_built_library_keeps_its_names_to_itself(built):
    _, files = built
    image = macho.read(files["libarapfields.dylib"])
    assert not macho.exports(image, "_omp_get_max_threads") and not macho.exports(image, "__ZdlPv")
    offered = [name for name, kind, _, _ in macho.symbols(image) if kind & 0xE and kind & 0x1]
    assert offered and all("10arapfields" in name for name in offered)
    assert set(macos_tools.system_symbols()).isdisjoint(offered)


@pytest.mark.skipif(not shutil.which("llvm-nm"), reason="no llvm-nm at hand")
def test_llvm_finds_the_same_symbols(built):
    _, files = built
    for name, file in files.items():
        if macos_check.OURS.fullmatch(name):
            command = ["llvm-nm", "--undefined-only", "--format=just-symbols", str(file)]
            listed = set(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split())
            image = macho.read(file)
            ours = {symbol for symbol, _ in macho.undefined_symbols(image)}
            assert listed - ours <= {"dyld_stub_binder"}
            # Of its own templates, any library's copy may be the process's: llvm-nm calls them defined.
            assert all(macho.exports(image, symbol) for symbol in ours - listed)
