# SPDX-License-Identifier: GPL-3.0-or-later
"""The C++ package: headers that stand alone, and a program that finds and links the library."""

import functools
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from support.geometry import meshes
from support.geometry.cases import turn
from support.programs.environments import BUILD, CMAKE, NATIVE, PUBLIC, ROOT, cached, run

import arapfields as af

# The C++ package's headers are whole, and its symbols those that they mark.

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


def test_exported_symbols_are_those_marked_in_headers(prefix):
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


def test_the_python_module_exports_only_its_init_function():
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


# The C++ package, found by CMake outside of the tree.

EXAMPLE = ROOT / "docs" / "examples" / "cpp"
PRINTED = 1e-5  # coordinates of the example's file have six digits


def build_example(folder, *definitions, python=sys.executable, target="bend"):
    """The program of a copy of the example in `folder`, compiled with Eigen from `python`'s cmeel-eigen."""
    shutil.copytree(EXAMPLE, folder / "source")
    ninja = ["-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={cached('CMAKE_MAKE_PROGRAM')}"]
    python = f"-DPython_EXECUTABLE={python}"
    run(CMAKE, "-S", folder / "source", "-B", folder / "build", *ninja, python, *definitions)
    run(CMAKE, "--build", folder / "build", "--target", target)
    return folder / "build" / target


def pillar():
    vertices, triangles = meshes.box((0.3, 0.3, 1.0))
    for _ in range(3):
        vertices, triangles = meshes.subdivide(vertices, triangles)
    return vertices, triangles


def slab(vertices, start, end):
    low, high = vertices.min(0), vertices.max(0)
    low[2], high[2] = low[2] + np.array([start, end]) * (high[2] - low[2])
    matrix = np.diag([*(0.51 * (high - low)), 1.0])
    matrix[:3, 3] = (low + high) / 2
    return matrix


BEND = """
import arapfields as af, numpy as np
vertices, triangles, held, turned, target = np.load("pillar.npz").values()
samples = af.sample_mesh(vertices, triangles, count=5000, seed=0)
handles = [af.Cuboid(held, held), af.Cuboid(turned, target)]
np.save("bent.npy", af.deform(samples, handles, af.DeformOptions(field="radial"))(vertices))
"""


@functools.cache
def bent(python):
    """What the example makes of the pillar, by the package of that Python: backends differ by more."""
    vertices, triangles = pillar()
    held, turned = slab(vertices, 0, 1 / 3), slab(vertices, 2 / 3, 1)
    with tempfile.TemporaryDirectory() as folder:
        np.savez(f"{folder}/pillar.npz", vertices, triangles, held, turned, turn([1, 0, 0], 60) @ turned)
        run(python, "-c", BEND, cwd=folder)
        return np.load(f"{folder}/bent.npy")


def write_obj(path, vertices, triangles):
    lines = [f"v {x} {y} {z}\n" for x, y, z in vertices] + [f"f {a} {b} {c}\n" for a, b, c in triangles + 1]
    path.write_text("".join(lines))


def check_example(program, tmp_path, python=sys.executable):
    """The program bends a pillar as that Python does."""
    vertices, triangles = pillar()
    rest, moved = tmp_path / "rest.obj", tmp_path / "moved.obj"
    write_obj(rest, vertices, triangles)
    assert re.fullmatch(r"stretch [\d.e-]+, bend [\d.e-]+\n", run(program, rest, moved, cwd=tmp_path))
    ours, same_triangles = meshes.read(moved)
    assert (same_triangles == triangles).all()
    assert np.abs(ours - bent(python)).max() < PRINTED
    (tmp_path / "empty.obj").write_text("v 0 0 0\n")
    refusals = {
        "arguments": [rest],  # what the library throws is caught
        "cannot be read": [tmp_path / "absent.obj", moved],
        "no faces": [tmp_path / "empty.obj", moved],
        "cannot be written": [rest, tmp_path / "absent" / "moved.obj"],
    }
    for word, arguments in refusals.items():
        refused = subprocess.run([program, *arguments], capture_output=True, text=True)
        assert refused.returncode == 2 and word in refused.stderr


def test_all_projects_require_one_cmake_version():
    """By every file that asks for one: ours, the examples', pip's and the page.

    The script that installs headers is run by itself, with the policies of CMake 2.4 unless it says so.
    """
    pattern = r'(?:cmake_minimum_required\(VERSION |\bcmake(?:\.version = ")?>=|CMake \()([\d.]+)'
    places = ["CMakeLists.txt", "pyproject.toml", "requirements.txt", "docs/cpp.md"]
    places += ["cmake/InstallHeaders.cmake", *EXAMPLE.parent.glob("cpp*/CMakeLists.txt")]
    asked = {str(path): re.search(pattern, (ROOT / path).read_text())[1] for path in places}
    assert len(asked) == 7 and len(set(asked.values())) == 1, asked


def test_the_cpp_example_agrees_with_python(tmp_path):
    """Against the wheel, whose neighbour has Eigen: no Python need be found, no environment be activated."""
    found = f"-Darapfields_DIR={run(sys.executable, '-m', 'arapfields', '--cmake-dir').strip()}"
    check_example(build_example(tmp_path, found, python=tmp_path / "absent"), tmp_path)


def test_the_calls_of_the_page_run(prefix, tmp_path):
    """Against what CMake installs. A call that is cancelled before it begins says so."""
    rest = tmp_path / "rest.obj"
    vertices, triangles = meshes.sphere(subdivisions=2)
    write_obj(rest, vertices, triangles)
    program = build_example(tmp_path, f"-DCMAKE_PREFIX_PATH={prefix}", target="calls")
    cancelled, *counts = run(program, rest, cwd=tmp_path).splitlines()
    assert cancelled.startswith("cancelled at 0")
    fit, ball, moved, _, posed, two, one, remeshed, on_triangles = map(int, " ".join(counts).split())
    assert min(fit, ball, remeshed) > 500 and two == on_triangles == 2000 and one == 1
    assert moved == posed == len(vertices)


@pytest.mark.slow
def test_the_example_builds_against_the_wheel_of_a_clean_environment(environment, tmp_path):
    """The manylinux wheel, with Eigen's headers from PyPI beside it."""
    run(environment, "-m", "pip", "install", "-q", "--disable-pip-version-check", "cmeel-eigen")
    place = run(environment, "-m", "arapfields", "--cmake-dir", cwd=tmp_path).strip()
    assert str(environment.parents[1]) in place
    program = build_example(tmp_path, f"-Darapfields_DIR={place}", python=environment)
    check_example(program, tmp_path, environment)


@pytest.mark.slow
def test_the_example_builds_the_library_along(tmp_path):
    """By FetchContent from the sources alone; optimised a little, since all of the library is compiled."""
    shutil.copytree(EXAMPLE, tmp_path / "cpp")
    shutil.copytree(EXAMPLE.with_name("cpp_from_source"), tmp_path / "source")
    ninja = ["-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={cached('CMAKE_MAKE_PROGRAM')}"]
    given = [f"-DPython_EXECUTABLE={sys.executable}", f"-DARAPFIELDS_SOURCE={ROOT}"]
    given += ["-DCMAKE_CXX_FLAGS_RELEASE=-O1", "-DCMAKE_BUILD_TYPE=Release"]
    run(CMAKE, "-S", tmp_path / "source", "-B", tmp_path / "build", *ninja, *given)
    run(CMAKE, "--build", tmp_path / "build", "--target", "bend")
    headers = sorted(path.name for path in (tmp_path / "build").rglob("include/arapfields/*.h"))
    assert headers == [path.name for path in PUBLIC]
    check_example(tmp_path / "build" / "bend", tmp_path)
