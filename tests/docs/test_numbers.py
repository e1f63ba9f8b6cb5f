# SPDX-License-Identifier: GPL-3.0-or-later
"""Each figure in the README and the pages comes from a command's file, or says that a hand typed it.

Put in by commands are <!-- NAME -->…<!-- end --> (docs/hooks/measured.py) and what stands between the marks
`bench` (tests/benchmarks/render.py). Else a sentence in italics, *By hand, MONTH YEAR: CONDITIONS*, stands in
the figure's paragraph or list, or as a paragraph of its own over what follows in its section; limits and
requirements, which nobody measured, have <!-- not measured --> there.
"""

import re

import pages
import pytest

PAGES = [page for page in pages.PAGES if page.name != "CHANGELOG.md"]
UNITS = (
    r"ms|µs|s|seconds|minutes|hours|(?:processor )seconds|per cent|%|[MG]i?B|GFLOP/s|"
    "times (?:faster|slower|the|as)"
)
QUANTITY = re.compile(rf"(?<![\w.])\d[\d,]*(?:\.\d+)?(?:e-?\d+)?[\s\u00a0]*(?:{UNITS})(?!\w)")
NUMERIC = re.compile(r"\s*[−-]?\d[\d,.]*(?:e-?\d+)?\s*(?:%|×)?\s*")
PUT_IN = re.compile(r"<!-- bench: begin -->.*?<!-- bench: end -->|<!-- \w+ -->.*?<!-- end -->", re.S)
BY_HAND = re.compile(r"\*By hand, [A-Z][a-z]+ 20\d\d: [^*]{10,}\*")
NOT_MEASURED = "<!-- not measured -->"


def has_figures(block):
    """Whether a quantity with a unit stands in it, or a table's row of three numbers or more."""
    rows = [line.split("|") for line in block.splitlines() if line.startswith("|")]
    return bool(QUANTITY.search(block)) or any(
        sum(bool(NUMERIC.fullmatch(c)) for c in row) > 2 for row in rows
    )


def unmarked(text):
    """The blocks, parted by empty lines, of a page's text that have figures of unknown origin."""
    found, below, last = (
        [],
        None,
        0,
    )  # level of the heading below which all was typed by hand; of the last one
    for block in re.split(r"\n\s*\n", PUT_IN.sub("", text)):
        heading, rest = re.match(r"(#+) ", block), BY_HAND.sub("", block).strip()
        if heading:
            last = len(heading[1])
            below = None if below is not None and last <= below else below
        elif not rest and below is None:
            below = last
        elif has_figures(rest) and rest == block.strip() and below is None and NOT_MEASURED not in block:
            found.append(block)
    return found


@pytest.mark.parametrize("page", PAGES, ids=pages.name)
def test_figures_say_where_they_come_from(page):
    assert not unmarked(pages.without_code(page))


TYPED = "It took 3 s.\n\n"
MARK = "*By hand, May 2026: on two busy cores.*"


def test_what_counts_as_marked():
    assert unmarked(TYPED) and unmarked("| a | 1 | 2.5 | 30 % |")
    assert not unmarked(f"It took 3 s. {MARK}")
    assert not unmarked(f"## A\n\n{MARK}\n\n{TYPED}### B\n\n{TYPED}")
    assert unmarked(f"## A\n\n{MARK}\n\n## B\n\n{TYPED}")
    assert unmarked(f"## A\n\nIt took 4 s. {MARK}\n\n{TYPED}")  # a paragraph's mark is its own
    assert not unmarked("It took <!-- live -->3 s<!-- end -->.")
    assert unmarked("It took 3 s. *By hand.*")
