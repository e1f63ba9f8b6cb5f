# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests marked `in_blender`: their bodies run in the Blender worker, their outcomes are pytest's.

A file of such tests is loaded twice: by pytest, which has no Blender, and by the worker. What only Blender
has is imported `if IN_BLENDER`. Arguments of such a test must be JSON, or the path `tmp_path`.
"""

import importlib.util
import sys

import pytest

IN_BLENDER = "bpy" in sys.modules


def require_bpy():
    """Skips the test where PyPI's bpy is absent, without loading it into this process."""
    if importlib.util.find_spec("bpy") is None:
        pytest.skip("PyPI's bpy is not installed")
