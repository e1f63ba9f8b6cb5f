# SPDX-License-Identifier: GPL-3.0-or-later
"""The structure of docs/architecture.md: licences, layers, circles, names and formats."""

import ast
import re
import subprocess
import sys
from collections import Counter
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

# The structure of docs/architecture.md, kept by tests: layering, what may import what.

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = [
    "core",
    "tensors",
    "options",
    "optimize",
    "mesh",
    "distance",
    "neural",
    "sampling",
    "fields",
    "energies",
    "solve",
    "solve/contact",
    "solve/radial",
    "solve/trained",
    "sharpen",
    "wrap",
    "attach",
    "curve",
    "skin",
    "splats",
    "extraction",
    "io",
]
SOURCE_FOLDERS = ["native", "addon", "blender_scripts", "cmake", "tests"]


def sources(*suffixes):
    files = []
    for folder in SOURCE_FOLDERS:
        files += [p for p in sorted((ROOT / folder).rglob("*")) if p.suffix in suffixes and p.is_file()]
    assert files, f"no {suffixes} files under {ROOT}"
    return files


def name(path):
    return path.relative_to(ROOT).as_posix()


def includes(path):
    return re.findall(r'^\s*#include\s+[<"]([^">]+)[">]', path.read_text(), flags=re.M)


def imported_modules(path):
    modules = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            modules |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            modules.add(node.module.split(".")[0])
    return modules


def test_every_source_names_its_licence():
    texts = {name(path): path.read_text() for path in sources(".cpp", ".h", ".py")}
    line = "SPDX-License-Identifier: GPL-3.0-or-later"
    assert not [path for path, text in texts.items() if text.strip() and line not in text[:200]]


def test_includes_follow_the_data_flow():
    wrong = []
    for position, folder in enumerate(FOLDERS):
        # Energies and fields know only jets; neither knows the other.
        allowed = {*FOLDERS[: position + 1]} - ({"fields"} if folder == "energies" else set())
        parts = {other for other in FOLDERS if other.startswith(folder.split("/")[0] + "/")}
        # A folder uses its parts, which do not use each other, except for contact: its planes are a term of
        # radial fields, and its solve is one of theirs (a test below tells circles of files).
        of_radial = {"solve/contact", "solve/radial"}
        own = of_radial if folder in of_radial else {folder}
        allowed = (allowed - parts) | own if "/" in folder else allowed | parts
        for path in (ROOT / "native" / folder).glob("*.*"):
            for include in includes(path):
                place = include.rpartition("/")[0]
                if place in {*FOLDERS, "bindings"} and place not in allowed:
                    wrong.append(f"{name(path)} includes {include}")
    assert not wrong, wrong


def test_no_headers_include_each_other():
    headers = [p for p in sources(".h") if name(p).startswith("native/")]
    wrong = [
        name(path)
        for path in headers
        for include in includes(path)
        if (ROOT / "native" / include).is_file() and path in reached(ROOT / "native" / include)
    ]
    assert not wrong, wrong


def reached(path, seen=None):
    """The file and, through one another, the headers of ours that it includes."""
    seen = set() if seen is None else seen
    if path not in seen:
        seen.add(path)
        for include in includes(path):
            for root in (ROOT / "native", ROOT / "native" / "include"):
                if (root / include).is_file():
                    reached(root / include, seen)
    return seen


def test_torch_stays_behind_the_tensors():
    """Nothing outside the tensors names ATen or torch; nothing but the backend of libtorch includes it."""
    native, door = ROOT / "native", ROOT / "native" / "tensors"
    pattern = re.compile(r"\b(lib)?torch|\bATen|\bat::|\bc10::", flags=re.I)
    others = [p for p in sources(".cpp", ".h") if native in p.parents and door not in p.parents]
    assert len(others) > 300
    assert not [name(p) for p in others if pattern.search(p.read_text())]
    backend = door / "torch"
    outside = [*others, *(p for p in door.rglob("*.*") if backend not in p.parents)]
    assert not [name(p) for p in outside for h in reached(p) if backend in h.parents]


def test_every_native_source_is_built():
    for folder in [*FOLDERS, "bindings"]:
        listed = (ROOT / "native" / folder / "CMakeLists.txt").read_text()
        pattern = "**/*.cpp" if folder == "tensors" else "*.cpp"  # its folders are backends
        missing = [p.name for p in (ROOT / "native" / folder).glob(pattern) if p.name not in listed]
        assert not missing, f"native/{folder}/CMakeLists.txt does not list {missing}"


def test_no_automatic_differentiation_in_native_code():
    pattern = re.compile(r"requires_grad|autograd|\.backward\(|torch::nn")
    native = [p for p in sources(".cpp", ".h") if name(p).startswith("native/")]
    assert not [name(p) for p in native if pattern.search(p.read_text())]


def test_no_thread_local_object_has_a_destructor():
    """Where threads end, MinGW frees such objects before it runs their destructors (GCC's bug 83562)."""
    found = [
        line
        for path in sources(".cpp", ".h")
        for line in re.findall(r"^ *(?:static )?thread_local (.*)", path.read_text(), flags=re.M)
    ]
    assert found
    assert not [line for line in found if not re.match(r"(bool|int|double|const \w+\*) \w+ = ", line)]


def test_bpy_stays_where_it_belongs():
    blender = {"bpy", "mathutils", "bl_ui"}
    places = [ROOT / "addon" / "core", ROOT / "native" / "python"]
    wrong = [name(p) for place in places for p in place.rglob("*.py") if imported_modules(p) & blender]
    assert not wrong, wrong


def test_nothing_looks_back_from_the_library_to_the_addon():
    library = (ROOT / "native" / "python").rglob("*.py")
    wrong = [name(p) for p in library if imported_modules(p) & {"addon", "torch"}]
    assert not wrong, wrong


def test_import_needs_neither_torch_nor_bpy():
    code = "import sys, arapfields; print(sorted({'torch', 'bpy', 'scipy'} & set(sys.modules)))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_the_library_never_links_torchs_python_part():
    import arapfields

    for library in Path(arapfields.__file__).parent.glob("*.so"):
        needed = subprocess.run(["ldd", str(library)], capture_output=True, text=True, check=True).stdout
        assert "libtorch_python" not in needed, library
        assert "not found" not in needed, needed


def test_top_level_folders_are_documented():
    text = (ROOT / "docs" / "architecture.md").read_text()
    command = ["git", "ls-files"]
    tracked = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    folders = {line.split("/")[0] for line in tracked.splitlines() if "/" in line and line[0] != "."}
    undocumented = {folder for folder in folders if f"{folder}/" not in text}
    assert not undocumented, undocumented


def test_an_installed_zip_is_tested_without_the_addons_sources():
    """Slow tests alone run these scripts, in Blenders that cannot import them."""
    folder = ROOT / "tests/support/blender"
    for path in (*folder.glob("installed*.py"), folder / "scenes.py", folder / "riders.py"):
        assert not re.search(r"^(from|import) addon\b", path.read_text(), flags=re.M), name(path)


def test_test_files_import_only_helpers():
    """What several use lies in tests/support; a test in Blender imports at the top, as other files do."""
    for path in (ROOT / "tests").rglob("test_*.py"):
        tree = ast.parse(path.read_text())
        imported = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
        names = [alias.name for node in imported for alias in node.names]
        names += [node.module or "" for node in imported if isinstance(node, ast.ImportFrom)]
        assert not [one for one in names if one.split(".")[-1].startswith("test_")], name(path)
        inner = {id(node) for top in tree.body if isinstance(top, ast.FunctionDef) for node in ast.walk(top)}
        local = [ast.unparse(node) for node in imported if id(node) in inner]
        words = ("import bpy", "support") if path.parent.name == "blender" else ("support",)
        assert not [line for line in local if any(word in line for word in words)], (name(path), local)


# Rules that single files do not show: circles, names defined twice, declarations of several names.

NATIVE = ROOT / "native"
PACKAGES = [ROOT / "addon", NATIVE / "python" / "arapfields"]


def included_files(path):
    """The files of ours that a C++ file includes."""
    for text in re.findall(r'^\s*#include\s+[<"]([^">]+)[">]', path.read_text(), flags=re.M):
        found = (root / text for root in (path.parent, NATIVE, NATIVE / "include"))
        yield from (file for file in found if file.is_file())


def imports(path, package):
    """The files of a Python package that one of its files imports, within functions too."""
    inside = path.relative_to(package).parent.parts
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level:
            folders = (*inside[: len(inside) - node.level + 1], *filter(None, (node.module or "").split(".")))
            base = package.joinpath(*folders)
            for alias in node.names:
                within = (base / f"{alias.name}.py", base / alias.name / "__init__.py")
                around = (base.with_suffix(".py"), base / "__init__.py")
                yield next(file for file in (*within, *around, path) if file.is_file())


@pytest.mark.parametrize("language", ["C++", "Python"])
def test_no_file_needs_itself_by_way_of_others(language):
    if language == "C++":
        files = [path for path in NATIVE.rglob("*") if path.suffix in (".h", ".cpp", ".cu")]
        graph = {path: set(included_files(path)) for path in files}
    else:
        graph = {p: {*imports(p, root)} - {p} for root in PACKAGES for p in root.rglob("*.py")}
    assert sum(map(len, graph.values())) > 300
    TopologicalSorter({name(path): {*map(name, needed)} for path, needed in graph.items()}).prepare()


def test_no_two_headers_define_one_name():
    """The library is one namespace: two classes of one name would share their functions when linked."""
    definition = (
        r"^(?:class|struct|enum class)\s+(?:ARAPFIELDS_\w+\s+)?(\w+)(?=\s*(?:final)?\s*(?:: [^;()]*)?\{)"
    )
    headers = {path: re.findall(definition, path.read_text(), flags=re.M) for path in NATIVE.rglob("*.h")}
    names = Counter(found for defined in headers.values() for found in defined)
    assert len(names) > 150
    assert not {found for found, times in names.items() if times > 1}


# Sources stand as clang-format and ruff leave them (`make format` does it).

TOOLS = Path(sys.executable).parent


def run(tool, *arguments):
    if not (TOOLS / tool).exists():
        pytest.skip(f"{tool} is not installed beside Python")
    done = subprocess.run([TOOLS / tool, *arguments], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_native_sources_are_formatted():
    sources = [str(path) for folder in ("native", "tests") for path in (ROOT / folder).rglob("*.[ch]*")]
    sources = sorted(path for path in sources if path.endswith((".h", ".cpp")))
    assert len(sources) > 100
    run("clang-format", "--dry-run", "--Werror", *sources)


def test_python_sources_are_formatted():
    run("ruff", "format", "--check", "-q", ".")


def test_python_sources_pass_the_linter():
    run("ruff", "check", "-q", ".")
