# SPDX-License-Identifier: GPL-3.0-or-later
"""The guide in the extension's zip: every page and picture that Blender's right click may open."""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "blender_scripts"))


@pytest.fixture(scope="module")
def files():
    from extension import guide

    return guide.guide_files(ROOT / "docs")


def test_every_page_is_there_and_links_lead_to_what_ships(files):
    pages = {name for name in files if name.endswith(".html")}
    assert pages == {f"guide/{page.stem}.html" for page in (ROOT / "docs/guide").glob("*.md")}
    for name in pages:
        html = files[name].decode()
        assert "<h1" in html and "<!-- settings" not in html
        anchors = {
            page: set(re.findall(r'id="([^"]+)"', content.decode()))
            for page, content in files.items()
            if page in pages
        }
        for target in re.findall(r'(?:href|src)="([^"]+)"', html):
            path, _, anchor = target.partition("#")
            there = f"guide/{path}" if path else name
            assert there in files, (name, target)
            assert anchor in {"", *anchors.get(there, ())}, (name, target)


def test_the_pages_that_tooltips_name_are_there(files):
    source = (ROOT / "addon/blender/guide.py").read_text()
    named = set(re.findall(r'"(?:ARAPFIELDS_PG_\w+)": "(\w+)"', source))
    assert len(named) > 3 and {f"guide/{page}.html" for page in named} <= {*files}
