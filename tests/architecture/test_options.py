# SPDX-License-Identifier: GPL-3.0-or-later
"""Every option is declared once, in native/options/options.toml, which reaches every surface."""

import ast
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.blender.inside import require_bpy

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "native" / "options"
sys.path[:0] = [str(FOLDER), str(ROOT / "docs" / "hooks")]

import cpp  # noqa: E402
import options as docs_tables  # noqa: E402
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


def test_ranges_are_declared_only_in_the_table():
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


# What the table of options says reaches every surface: C++, Python, stub, flags, Blender, documentation.


# (operation, option, what the table says, what it shall say): one of each type.
CHANGES = [
    ("deform", "centers", "default = 1500\nrange = [5, 3000]", "default = 345\nrange = [5, 3000]"),
    ("stylize", "bending", "bending = { default = 0.1", "bending = { default = 0.0625"),
    ("fit", "optimizer", 'default = "muon"', 'default = "adam"'),
    ("deform", "exact_handles", 'default = false\nlabel = "Exact', 'default = true\nlabel = "Exact'),
    ("deform", "seed", 'type = "seed"\ndefault = 0', 'type = "seed"\ndefault = 77'),
]


@pytest.fixture(scope="module")
def changed(tmp_path_factory):
    """A clone's part with another table, and what the generator makes there."""
    folder = tmp_path_factory.mktemp("clone")
    text = (FOLDER / "options.toml").read_text()
    for _, _, before, after in CHANGES:
        assert text.count(before) == 1, before
        text = text.replace(before, after)
    (folder / "options.toml").write_text(text)
    command = [sys.executable, FOLDER / "generate.py", folder, "--table", folder / "options.toml"]
    subprocess.run(command, check=True)
    return folder


def value_in(folder, operation, name):
    table = json.loads((folder / "options.json").read_text())
    return next(o["default"] for o in table[operation]["options"] if o["name"] == name)


@pytest.mark.parametrize(("operation", "name", "before", "after"), CHANGES)
def test_a_changed_default_reaches_every_surface(changed, operation, name, before, after):
    present = next(o for o in TABLE[operation]["options"] if o["name"] == name)
    value = value_in(changed, operation, name)
    assert value != present["default"]
    table = options_table.resolved(changed / "options.toml")
    option = next(o for o in table[operation]["options"] if o["name"] == name)
    # C++: the member's initialiser, in the operation's header or in that of its group.
    headers = "".join(path.read_text() for path in (changed / "options").glob("*.h"))
    assert re.search(rf"\b{name} = {re.escape(cpp.literal(option))}\b", headers)
    # Python: the signature that the class and its stub get.
    struct = table[operation]["struct"]
    bound = (changed / "options" / "bind_options.cpp").read_text().split(f"bind_struct<{struct}>")[1]
    assert f"{name}: {cpp.hint(option)} = {value!r}" in bound.split("\n", 1)[0]
    # The documentation's tables.
    page = docs_tables.filled(f"<!-- flags: {operation} -->", table)
    assert re.search(rf"`--{name.replace('_', '-')}` \| `{re.escape(str(value))}`", page)


def test_a_changed_default_reaches_the_flags(changed, monkeypatch, capsys):
    from arapfields import _options
    from arapfields.cli import parser

    monkeypatch.setattr(_options, "TABLE", json.loads((changed / "options.json").read_text()))
    for operation, name, _, _ in CHANGES:
        with pytest.raises(SystemExit):
            parser.parse([operation, "--help"])
        value = value_in(changed, operation, name)
        shown = {True: "on", False: "off"}.get(value, value) if isinstance(value, bool) else value
        text = " ".join(capsys.readouterr().out.split())
        assert re.search(rf"--{name.replace('_', '-')}\b[^\[\]]* \[{re.escape(str(shown))}\]", text), (
            name,
            text,
        )


PROPERTIES = """
import sys, bpy
sys.path.insert(0, sys.argv[1])
import addon
addon.register()
bpy.ops.mesh.primitive_cube_add()
settings = bpy.context.object.arapfields
print("DEFAULTS", settings.stylize.bending, settings.deform.exact_handles, settings.deform.seed)
"""


def test_a_changed_default_reaches_blenders_properties(changed, tmp_path):
    require_bpy()
    (tmp_path / "native" / "options").mkdir(parents=True)
    (tmp_path / "native" / "options" / "options.toml").write_text((changed / "options.toml").read_text())
    (tmp_path / "native" / "options" / "table.py").write_text((FOLDER / "table.py").read_text())
    shutil.copytree(ROOT / "addon", tmp_path / "addon", ignore=shutil.ignore_patterns("__pycache__"))
    command = [sys.executable, "-c", PROPERTIES + "import os; sys.stdout.flush(); os._exit(0)", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert "DEFAULTS 0.0625 True 77" in done.stdout, done.stdout + done.stderr


def test_the_installed_stub_has_the_tables_signatures():
    import arapfields

    package = Path(arapfields.__file__).parent
    assert json.loads((package / "options.json").read_text()) == json.loads(json.dumps(TABLE))
    classes = {n.name: n for n in ast.parse((package / "_native.pyi").read_text()).body if hasattr(n, "name")}
    for block in TABLE.values():
        if not block["python"]:
            continue
        methods = {n.name: n for n in classes[block["struct"]].body if isinstance(n, ast.FunctionDef)}
        arguments = methods["__init__"].args
        given = {
            argument.arg: (ast.unparse(argument.annotation), ast.literal_eval(value))
            for argument, value in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
        }
        assert given == {o["name"]: (cpp.hint(o), o["default"]) for o in block["options"]}
