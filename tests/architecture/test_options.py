# SPDX-License-Identifier: GPL-3.0-or-later
"""Every option is declared once, in native/options/options.toml."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "native" / "options"
sys.path.insert(0, str(FOLDER))

import table as options_table  # noqa: E402

TABLE = options_table.resolved()
OPTIONS = [(name, o) for name, block in TABLE.items() for o in (*block["options"], *block["further"])]
NAMES = {option["name"] for _, option in OPTIONS}
# Words that name other things too, such as a weight of one handle or the number of lines of a report.
COMMON = {"samples", "field", "start", "count", "margin", "strength", "interior", "spacing", "tolerance"}


def tracked(*suffixes):
    command = ["git", "ls-files", "native", "addon", "blender_scripts", "docs", "README.md"]
    names = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\n")
    sources = [ROOT / name for name in names if name.endswith(suffixes) and (ROOT / name).is_file()]
    assert len(sources) > 20
    return sources


def cpp_defaults(text):
    """(name, literal) of members and parameters with a default, and of bound arguments."""
    kinds = r"(?:int|bool|float|double|Index|std::u?int\d+_t|std::string)"
    yield from re.findall(rf"\b{kinds} (\w+) = ([-+\w.\"]+)(?=[;,)])", text)
    yield from re.findall(r'"(\w+)"_a = ([-+\w.\"]+)', text)


def python_defaults(tree):
    """(name, literal) of arguments with a default, and of fields of classes."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            arguments = node.args
            named = [*arguments.posonlyargs, *arguments.args][-len(arguments.defaults) or None :]
            pairs = [*zip(named, arguments.defaults, strict=False)]
            pairs += zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
            yield from ((a.arg, ast.unparse(v)) for a, v in pairs if isinstance(v, ast.Constant))
        elif isinstance(node, ast.ClassDef):
            for line in node.body:
                if isinstance(line, ast.AnnAssign) and isinstance(line.value, ast.Constant):
                    yield line.target.id, ast.unparse(line.value)


def is_default(name, text):
    """Whether a literal is the default of an option of that name."""
    try:
        value = ast.literal_eval({"true": "True", "false": "False"}.get(text, text))
    except (ValueError, SyntaxError):
        return False
    neutral = (None, 0, 1, "")  # starts of sums and products, no choices
    return value not in neutral and any(o["name"] == name and o["default"] == value for _, o in OPTIONS)


def copies_of_defaults(found):
    return [f"{name} = {text}" for name, text in found if name in NAMES - COMMON and is_default(name, text)]


def test_the_search_for_copies_finds_them():
    code = (
        'struct A { int width = 256; double bending = 0.01; };\nm.def("f", "resolution"_a = 256, "n"_a = 3);'
    )
    assert copies_of_defaults(cpp_defaults(code)) == ["width = 256", "bending = 0.01", "resolution = 256"]
    tree = ast.parse(
        "def f(mesh, resolution=256, *, seed=0, barrier=10.0): pass\nclass A:\n    batch: int = 500"
    )
    assert copies_of_defaults(python_defaults(tree)) == ["resolution = 256", "barrier = 10.0", "batch = 500"]


def test_no_default_stands_twice():
    wrong = {}
    for path in tracked(".cpp", ".h"):
        wrong[path] = copies_of_defaults(cpp_defaults(path.read_text()))
    for path in tracked(".py"):
        if path.is_relative_to(ROOT / "native") or path.is_relative_to(ROOT / "addon"):
            wrong[path] = copies_of_defaults(python_defaults(ast.parse(path.read_text())))
    assert not {str(path.relative_to(ROOT)): found for path, found in wrong.items() if found}


def test_ranges_stand_in_the_table_alone():
    """Neither a check in C++ nor a property in Blender nor a flag gives one of these options a range."""
    checks = re.compile(r'require_(?:range|positive|not_negative)\(\s*"(\w+)"')
    sources = [
        path for path in tracked(".cpp", ".h") if "core" not in path.parts
    ]  # which lies under the table
    calls = [(path.name, name) for path in sources for name in checks.findall(path.read_text())]
    wrong = [(path, name) for path, name in calls if name in NAMES - COMMON]
    for path in tracked(".py"):
        text = path.read_text()
        if path.is_relative_to(ROOT / "addon"):
            properties = re.findall(r"\b(\w+)\s*[:=]\s*(?:bpy\.props\.)?(?:Int|Float|Bool)Property\(", text)
            wrong += [(path.name, name) for name in properties if name in NAMES - COMMON]
        if path.is_relative_to(ROOT / "native" / "python"):
            flags = re.findall(r'"--([\w-]+)",?\s+type=(?:int|float)', text)
            wrong += [(path.name, flag) for flag in flags if flag.replace("-", "_") in NAMES]
    assert not wrong


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("bending = { default = 0.1", "bending = { default = 1.0"), "the same as declared"),
        (("soft = [8, 512]", "soft = [8, 512]\ncolour = 1"), "unknown key 'colour'"),
        (("[1, 8192]", "[300, 8192]"), "default 256 is not within 300 to 8192"),
        (('default = "muon"', 'default = "newton"'), "'newton' is no choice"),
        (('"width", "layers"', '"width", "width"'), "'width' twice"),
        (("smoothness = ", "smoothness = "), None),
        (("[fit.override]", "[fit.override]\nrigidity = { default = 2.0 }"), "'rigidity' is no member"),
    ],
)
def test_a_broken_table_is_refused(tmp_path, change, message):
    text = (FOLDER / "options.toml").read_text().replace(*change)
    (tmp_path / "options.toml").write_text(text)
    if message is None:
        assert options_table.resolved(tmp_path / "options.toml") == TABLE
        return
    with pytest.raises(options_table.TableError, match=message):
        options_table.resolved(tmp_path / "options.toml")
