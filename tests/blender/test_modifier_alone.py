# SPDX-License-Identifier: GPL-3.0-or-later
"""The modifier, its inputs and copies of modifiers in all versions of Blender, without the library."""

import pytest
from support.blender import blenders


@pytest.mark.parametrize("name", ["4.2", "4.5", "5.2"])
def test_the_modifier_works_without_the_library(name, tmp_path):
    assert "modifier works in" in blenders.find(name, tmp_path).run("modifier_alone.py").stdout
