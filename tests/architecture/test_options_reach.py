# SPDX-License-Identifier: GPL-3.0-or-later
"""What the table of options says reaches every surface: C++, Python, stub, flags, Blender, documentation."""

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
