# SPDX-License-Identifier: GPL-3.0-or-later
"""Rules that single files do not show: circles, names defined twice, declarations of several names."""

import ast
import re
from collections import Counter
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NATIVE = ROOT / "native"
PACKAGES = [ROOT / "addon", NATIVE / "python" / "arapfields"]


def name(path):
    return path.relative_to(ROOT).as_posix()


def includes(path):
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
        graph = {path: set(includes(path)) for path in files}
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
