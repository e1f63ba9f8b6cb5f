# SPDX-License-Identifier: GPL-3.0-or-later
"""The continuous integration files: well-formed, plain about not having been run, in step with the rest."""

import re
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
ROOT = Path(__file__).resolve().parents[2]
FILES = sorted((ROOT / ".github/workflows").glob("*.yml"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_workflow_runs_what_there_is(path):
    text = path.read_text()
    assert text.startswith("# NOT RUN ON GITHUB YET")
    content = yaml.safe_load(text)
    steps = [step for job in content["jobs"].values() for step in job["steps"]]
    assert all(("run" in step) != ("uses" in step) for step in steps)
    commands = "\n".join(step.get("run", "") for step in steps)
    makefile = (ROOT / "Makefile").read_text()
    for word in re.findall(r"\bmake ([a-z-]+)", commands):
        assert re.search(rf"^{word}:", makefile, flags=re.M), word
    for name in re.findall(r"\b(?:tests|blender_scripts|wheel_scripts)/[\w/.]+", commands):
        assert (ROOT / name).exists(), name


def test_there_are_wheels_for_every_system():
    content = yaml.safe_load((ROOT / ".github/workflows/wheels.yml").read_text())
    systems = {job["runs-on"].split("-")[0] for job in content["jobs"].values()}
    assert systems == {"ubuntu", "windows", "macos"}
