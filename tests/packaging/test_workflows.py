# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that other services read: workflows, words of the Makefile, citation."""

import re
import sys
import tomllib
from pathlib import Path

import pytest

# The continuous integration files: well-formed, plain about not having been run, in step with the rest.

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "cmake/wheel"))

from platforms import PYTHONS  # noqa: E402

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
FILES = sorted((ROOT / ".github/workflows").glob("*.yml"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_workflows_run_existing_commands(path):
    text = path.read_text()
    assert text.startswith("# NOT RUN ON GITHUB YET")
    content = yaml.safe_load(text)
    steps = [step for job in content["jobs"].values() for step in job["steps"]]
    assert all(("run" in step) != ("uses" in step) for step in steps)
    commands = "\n".join(step.get("run", "") for step in steps)
    makefile = (ROOT / "Makefile").read_text()
    for word in re.findall(r"\bmake ([a-z-]+)", commands):
        assert re.search(rf"^{word}:", makefile, flags=re.M), word
    for name in re.findall(r"\b(?:tests|blender_scripts)/[\w/.]+", commands):
        assert (ROOT / name).exists(), name


def test_wheels_are_tried_on_every_system():
    content = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text())
    matrix = content["jobs"]["elsewhere"]["strategy"]["matrix"]
    assert {name.split("-")[0] for name in matrix["system"]} == {"ubuntu", "windows", "macos"}
    assert matrix["python"] == ["{}.{}".format(*version) for version in PYTHONS]


def test_every_word_of_make_is_described():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    words = set(re.findall(r"^([a-z0-9-]+):.*##", makefile, flags=re.M)) - {"help"}
    phony = set(re.search(r"^\.PHONY: (.*)$", makefile, flags=re.M)[1].split()) - {"help"}
    assert words == phony
    assert "`make help` lists" in (ROOT / "docs/development.md").read_text(encoding="utf-8")


# CITATION.cff says what the project's other files say.


def test_the_citation_is_of_this_version():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert (cited["cff-version"], cited["type"]) == ("1.2.0", "software")
    assert (cited["version"], cited["license"]) == (project["version"], project["license"])
    assert cited["message"] and cited["authors"] and cited["title"] == "ARAP Fields"
    papers = (ROOT / "docs/references.bib").read_text()
    assert len(cited["references"]) == 2
    for paper in cited["references"]:
        assert f"{{{paper['title']}}}" in papers and f"{{{paper['year']}}}" in papers
        assert all(author["family-names"] in papers for author in paper["authors"])
