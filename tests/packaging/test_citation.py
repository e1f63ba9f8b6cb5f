# SPDX-License-Identifier: GPL-3.0-or-later
"""CITATION.cff says what the project's other files say."""

import tomllib
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")

ROOT = Path(__file__).resolve().parents[2]


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
