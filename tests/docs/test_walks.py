# SPDX-License-Identifier: GPL-3.0-or-later
"""The five walks of docs/architecture.md: each at most eight files, in the order of the call."""

import re

import pages
import pytest

PAGE = pages.ROOT / "docs" / "architecture.md"
WALKS = ["Deform", "Drag a pin", "`af.wrap`", "Bake with a carried object", "Add an option"]
MOST_FILES = 8


def walks():
    """{title: text} of the section's walks."""
    section = re.search(r"^## Five walks$(.*?)^## ", PAGE.read_text(), re.S | re.M)[1]
    parts = re.split(r"^### (.*)$", section, flags=re.M)[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def test_there_are_five_walks():
    assert list(walks()) == WALKS


@pytest.mark.parametrize("walk", WALKS)
def test_each_step_of_a_walk_is_a_file_that_exists(walk):
    steps = re.findall(r"^(\d+)\. `([^`]+)`: \w", walks()[walk], re.M)
    assert [int(number) for number, _ in steps] == list(range(1, len(steps) + 1))
    assert 4 <= len(steps) <= MOST_FILES
    assert not [path for _, path in steps if not (pages.ROOT / path).is_file()]
