# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests marked `in_blender`: their bodies run in the Blender worker, pytest reports the outcomes.

A file of such tests is imported twice: by pytest, without Blender, and by the worker. Modules that exist only
in Blender are imported `if IN_BLENDER`. Arguments of such tests must be JSON, or `tmp_path`.
"""

import importlib.util
import sys

import pytest

IN_BLENDER = "bpy" in sys.modules


def require_bpy():
    """Skips the test if bpy is not installed, without importing it."""
    if importlib.util.find_spec("bpy") is None:
        pytest.skip("PyPI's bpy is not installed")
