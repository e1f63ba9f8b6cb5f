# SPDX-License-Identifier: GPL-3.0-or-later
"""The verdicts on the checks in Blender's window (tests/gui), without a window."""

import ast
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests.gui.__main__ import groups
from tests.gui.verdicts import EXPECTED, TRUE, above, failures, having, is_, near

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = [*sorted((ROOT / "tests/gui").glob("*.py")), ROOT / "blender_scripts/film.py"]


def figure_names(path):
    """Names, said in full, under which a script puts what it has found."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store):
            is_figure = isinstance(node.value, ast.Name) and node.value.id == "figures"
            if is_figure and isinstance(node.slice, ast.Constant):
                yield node.slice.value


def test_each_finding_of_each_script_has_its_verdict():
    expected = {name for rules in EXPECTED.values() for name in rules} | {"error"}
    keys = {key for path in SCRIPTS for key in figure_names(path)}
    assert len(keys) > 50 and not keys - expected, keys - expected


@pytest.mark.parametrize(
    ("rule", "good", "bad"),
    [
        (TRUE, True, [False, None, 1.5]),
        (is_((["Bar"], [])), [["Bar"], []], [["Bar"], ["X"]]),
        (above(0.2), 0.3, [0.2, None, "x"]),
        (near(45.0, 10.0), -44.0, [30.0]),
        (TRUE.each(2), [True, True], [[True], [True, False], None]),
        (having(exact=TRUE), {"exact": True, "more": 1}, [{}, {"exact": False}, []]),
    ],
)
def test_rules(rule, good, bad, monkeypatch):
    monkeypatch.setitem(EXPECTED, "part", {"name": rule})
    assert failures({"name": good}, ["part"]) == []
    for value in bad:
        (line,) = failures({"name": value}, ["part"])
        assert line.startswith("part: name is ") and rule.text in line
    assert failures({}, ["part"]) == [f"part: name is missing; {rule.text} is expected"]
    assert failures({"name": good, "error": "Traceback"}, ["part"]) == ["Traceback"]


def test_scripts_with_an_own_blender_are_grouped_apart():
    assert groups(["jobs", "tutorial", "pins", "film=x"]) == [["jobs", "pins"], ["tutorial"], ["film=x"]]
    with pytest.raises(SystemExit, match="no check is named nonsense"):
        groups(["nonsense"])


BLENDER = """import json, sys
from pathlib import Path
folder, *names = sys.argv[sys.argv.index("--") + 1 :]
path = Path(folder) / "judged.json"
path.parent.mkdir(exist_ok=True)
said = json.loads(path.read_text()) if path.exists() else {}
for name in names:
    said[name] = WRONG.get(name, [])
    path.write_text(json.dumps(said))
    if name in LAST:
        sys.exit(1)
sys.exit(CODE if any(said.values()) else 0)
"""


@pytest.mark.parametrize(
    ("given", "failed"),
    [
        ("WRONG, LAST, CODE = {}, (), 0", []),
        ("WRONG, LAST, CODE = {'use': ['x is 1']}, (), 1", ["use"]),
        ("WRONG, LAST, CODE = {'use': ['it broke off']}, ('use',), 0", ["use"]),
        ("WRONG, LAST, CODE = {}, ('tutorial',), 0", ["tutorial"]),
        ("raise SystemExit(1)", ["use", "jobs", "tutorial"]),
    ],
)
def test_the_runner_says_of_each_part_how_it_ended(given, failed, tmp_path):
    blender = tmp_path / "blender.py"
    blender.write_text(f"{given}\n{BLENDER}")
    environment = {**os.environ, "ARAPFIELDS_WINDOW": shlex.join([sys.executable, str(blender)])}
    command = [sys.executable, "-m", "tests.gui", "--output", str(tmp_path), "use", "jobs", "tutorial"]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == bool(failed), done
    *parts, last = done.stdout.splitlines()
    for name, line in zip(("use", "jobs", "tutorial"), parts, strict=True):
        assert line.split()[0] == name and ("FAILED: " in line) == (name in failed), line
        assert ("as expected" in line) == (name not in failed)
    assert last == (f"FAILED: {'; '.join(failed)}" if failed else "all as expected")
