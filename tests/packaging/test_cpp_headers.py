# SPDX-License-Identifier: GPL-3.0-or-later
"""The C++ package's headers are whole, and its symbols those that they mark."""

import re
from pathlib import Path

import pytest
from support.programs.environments import run
from support.programs.native_build import BUILD, NATIVE, PUBLIC, cached

import arapfields as af

LIBRARY = Path(af.__file__).parent / "libarapfields.so"


def compiler():
    return cached("CMAKE_CXX_COMPILER")


def compile_alone(source, include_dirs, *flags):
    """Parses a source, or compiles a header where the flags say so."""
    includes = [f"-I{folder}" for folder in include_dirs]
    command = [compiler(), "-std=c++20", "-Wall", "-Wextra", "-Werror", *flags]
    run(*command, *includes, f"-isystem{cached('EIGEN_INCLUDE_DIR')}", source)


def alone(header, folder):
    """A source that includes nothing but the header, twice."""
    path = folder / "alone.cpp"
    path.write_text(f'#include "{header}"\n' * 2)
    return path


ALIGNED = "-DEIGEN_MAX_ALIGN_BYTES=16"
TYPES = "arapfields/core/types.h"


@pytest.fixture(scope="module")
def parsed_types(prefix, tmp_path_factory):
    """Flags by which the header of Eigen's types, most of the work, is parsed once for all."""
    folder = tmp_path_factory.mktemp("parsed")
    kind = ["-x", "c++-header", "-o", folder / "types.gch"]
    compile_alone(alone(TYPES, folder), [prefix / "include"], ALIGNED, *kind)
    return ["-include", folder / "types", "-Winvalid-pch"]


def reaches(header, wanted, folder):
    """Whether a header includes another, or one that does."""
    names = re.findall(r'#include "(.*)"', (folder / header).read_text())
    return wanted in names or any(reaches(name, wanted, folder) for name in names)


@pytest.mark.parametrize("header", PUBLIC, ids=lambda path: path.stem)
def test_each_public_header_compiles_alone(header, prefix, parsed_types, tmp_path):
    name, folder = f"arapfields/{header.name}", prefix / "include"
    parsed = parsed_types if reaches(name, TYPES, folder) else []
    compile_alone(alone(name, tmp_path), [folder], ALIGNED, "-fsyntax-only", *parsed)


def test_installed_headers_need_neither_torch_nor_kernels(prefix):
    installed = sorted((prefix / "include").rglob("*.h"))
    assert {path.name for path in PUBLIC} <= {path.name for path in installed}
    for path in installed:
        text = re.sub(r"//[^\n]*", "", path.read_text())
        wrong = re.findall(
            r"#include [<\"](?:ATen|torch|c10|immintrin).*|.*SIMD_LEVEL.*|.*ARAPFIELDS_DECLARE.*", text
        )
        assert not wrong, (path, wrong)
        for name in re.findall(r'#include "(.*)"', text):
            assert (prefix / "include" / name).is_file(), f"{path} includes {name}, which is not installed"


def test_the_umbrella_has_every_header():
    umbrella = (NATIVE / "include" / "arapfields" / "arapfields.h").read_text()
    assert re.findall(r'"arapfields/(\w+)\.h"', umbrella) == [
        p.stem for p in PUBLIC if p.stem != "arapfields"
    ]


def demangled(*options):
    """Names of the library's dynamic symbols."""
    return run("nm", "-D", "-C", *options, LIBRARY).splitlines()


MARK = r"ARAPFIELDS_EXPORT(?P<tests>_TO_TESTS)? "


def marked(path):
    """(name, for tests alone) of the classes and functions that a header marks as exported."""
    text = re.sub(r"//[^\n]*", "", path.read_text())
    for match in re.finditer(rf"(?:class|struct) {MARK}(?P<name>\w+)", text):
        yield match["name"], bool(match["tests"])
    for match in re.finditer(rf"^{MARK}[^;{{]*?(?P<name>\w+)\(", text, re.M):
        yield match["name"], bool(match["tests"])


def test_what_is_exported_is_what_headers_mark(prefix):
    """By class or function: all of them, no other, and what is not for our tests alone is installed."""
    roots = {path: root for root in (NATIVE, BUILD / "generated") for path in root.rglob("*.h")}
    headers = [path for path in roots if "include" not in path.relative_to(roots[path]).parts]
    marks = {name: (path, tests) for path in headers for name, tests in marked(path)}
    hidden = [
        f"{name} of {path.name}"
        for name, (path, tests) in marks.items()
        if not tests and not (prefix / "include" / "arapfields" / path.relative_to(roots[path])).is_file()
    ]
    assert not hidden, f"exported, but in no installed header: {hidden}"
    exported = set()
    for line in demangled("--defined-only"):
        owner = re.search(r"(?:^|[ *&])arapfields::(\w+)", line[19:].split("(")[0].replace("(anonymous", ""))
        assert owner, f"exported, but not ours: {line}"
        names = re.findall(r"arapfields::(\w+)", line[19:].split("(")[0])
        assert set(names) & set(marks), f"exported, but not marked: {line}"
        exported |= set(names)
    missing = set(marks) - exported
    assert not missing, f"marked, but without a symbol: {missing}"


def test_the_python_module_exports_its_start_alone():
    """Of what the standard library has, torch would find ours, where the compiler links it statically."""
    (module,) = LIBRARY.parent.glob("_native*.so")
    found = run("nm", "-D", "--defined-only", module).splitlines()
    assert [line.split()[-1].partition("@")[0] for line in found] == ["PyInit__native"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "folder", sorted(path.name for path in NATIVE.iterdir() if (path / "CMakeLists.txt").exists())
)
def test_each_header_of_the_tree_compiles_alone(folder, tmp_path):
    """As the compiler sees them in a source of their kind, but without the precompiled header."""
    if folder == "bindings":
        pytest.skip("they need Python's headers, which every source includes first")
    torch = cached("LIBTORCH_DIR")
    system = [f"-isystem{torch}/include", f"-isystem{torch}/include/torch/csrc/api/include"]
    system += [f"-isystem{cached('JSON_INCLUDE_DIR')}"] if folder == "io" else []
    defined = [ALIGNED, "-DSIMD_LEVEL=baseline", "-Wno-unused-function", "-Wno-psabi"]
    for header in sorted((NATIVE / folder).glob("*.h")):
        source = alone(f"{folder}/{header.name}", tmp_path)
        compile_alone(source, [NATIVE, BUILD / "generated"], "-fsyntax-only", *system, *defined)
