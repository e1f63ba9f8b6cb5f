# SPDX-License-Identifier: GPL-3.0-or-later
"""The modifier, its inputs and copies of modifiers in all versions of Blender, without the library."""

import pytest
from support.blender import blenders


@pytest.mark.parametrize("name", blenders.VERSIONS)
def test_the_modifier_works_without_the_library(name, tmp_path):
    assert "modifier works in" in blenders.find(name, tmp_path).run("modifier_alone.py").stdout
