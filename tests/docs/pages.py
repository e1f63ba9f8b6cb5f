# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation's pages, and the Python blocks in them."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```\s*$", re.S | re.M)


def name(page):
    return str(page.relative_to(ROOT))


def python_blocks(page):
    """(line, code) of each Python block, in order."""
    text = page.read_text()
    return [(text[: m.start()].count("\n") + 2, m[2]) for m in FENCE.finditer(text) if m[1] == "python"]


def without_code(page):
    text = FENCE.sub("", page.read_text())
    return re.sub(r"`[^`\n]*`", "", text)


def anchors(page):
    """Anchors of a page's headings by MkDocs' rules."""
    from markdown.extensions.toc import slugify

    found = []
    for title in re.findall(r"^#+ +(.*?)\s*$", FENCE.sub("", page.read_text()), re.M):
        found.append(slugify(re.sub(r"[`*$]", "", title), "-"))
    return set(found)
