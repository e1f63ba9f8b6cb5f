# SPDX-License-Identifier: GPL-3.0-or-later
"""The script that runs the workflows' steps here: order, environment, what is left out and why."""

import argparse
import sys
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).parent))

import run_workflow  # noqa: E402

FILES = sorted((ROOT / ".github/workflows").glob("*.yml"))
WORKFLOW = """
jobs:
  small:
    runs-on: ubuntu-24.04
    env: {GREETING: hello}
    strategy:
      matrix:
        letter: [a, b]
        include:
          - letter: b
            more: extra
    steps:
      - uses: actions/checkout@v4
      - run: sudo apt-get update && sudo apt-get install -y nothing
      - uses: somebody/else@v1
      - run: echo "$GREETING ${{ matrix.letter }}${{ matrix.more }}" > out.txt
      - run: echo "NEXT=$(cat out.txt) again" >> "$GITHUB_ENV"
      - if: ${{ matrix.more }}
        run: test -f README.md && echo "$NEXT" > out.txt
      - uses: actions/upload-artifact@v4
        with: {name: "${{ matrix.letter }}", path: out.txt, if-no-files-found: error}
  elsewhere:
    runs-on: windows-2022
    steps:
      - run: dir
"""
CHECKOUT = "- uses: actions/checkout@v4"
NOTHING = "{name: x, path: '*.zip', if-no-files-found: error}"


def run(text, folder, **given):
    path = folder / "small.yml"
    path.write_text(text)
    given = {"job": None, "matrix": [], "plan": False, "keep": [], "limit": 60.0, **given}
    options = argparse.Namespace(workflow=[path], folder=folder / "runs", **given)
    return run_workflow.main(options)


def test_steps_run_in_order_with_what_those_before_left(tmp_path, capsys):
    assert run(WORKFLOW, tmp_path) == 0
    kept = {path.parent.name: path.read_text() for path in (tmp_path / "runs").glob("*/artifacts/*/out.txt")}
    assert kept == {"a": "hello a\n", "b": "hello bextra again\n"}
    output = capsys.readouterr().out
    assert "| small elsewhere | all steps | left out | needs windows-2022 |" in output
    assert "installs packages of the system: sudo apt-get" in output
    assert "somebody/else has no substitute here" in output


@pytest.mark.parametrize(
    ("step", "reason"),
    [
        ("- run: 'false'", "returned non-zero"),
        ("- run: sleep 30", "not done after"),
        (
            f"- uses: actions/upload-artifact@v4\n        with: {NOTHING}",
            "nothing like",
        ),
    ],
)
def test_a_failed_step_ends_its_job(step, reason, tmp_path, capsys):
    text = f"jobs:\n  one:\n    runs-on: ubuntu-24.04\n    steps:\n      {CHECKOUT}\n      {step}\n"
    assert run(text + "      - run: touch never\n", tmp_path, limit=1.0) == 1
    assert reason in capsys.readouterr().out
    assert not list((tmp_path / "runs").glob("*/clone/never"))


def test_an_unknown_expression_is_no_empty_text():
    with pytest.raises(ValueError, match=r"secrets\.TOKEN"):
        run_workflow.filled("${{ secrets.TOKEN }}", {})


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_step_of_ours_is_understood(path):
    for _, content, values in run_workflow.jobs(path):
        for step in content["steps"]:
            kind, what = run_workflow.plan(step, values)
            known = ("its condition", "installs packages", "actions/download-artifact has no substitute")
            assert kind != "left out" or what.startswith(known), (step, what)


def test_a_python_that_does_not_start_is_passed_over(tmp_path):
    """pyenv's names lie in PATH and end with 127 where that version is not chosen."""
    for folder, text in (("shims", "exit 127"), ("whole", "exit 0")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "python9.9").write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / folder / "python9.9").chmod(0o755)
    assert run_workflow.interpreter("9.9", str(tmp_path / "whole")).endswith("whole/python9.9")
    with pytest.raises(RuntimeError, match=r"no python9\.9"):
        run_workflow.interpreter("9.9", str(tmp_path / "shims"))
