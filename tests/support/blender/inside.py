# SPDX-License-Identifier: GPL-3.0-or-later
"""@in_blender: the test's body runs in the Blender worker, its outcome is pytest's.

A file of such tests is loaded twice: by pytest, which has no Blender, and by the worker. What only Blender
has is imported `if IN_BLENDER`.
"""

import functools
import importlib.util
import inspect
import sys

import pytest

IN_BLENDER = "bpy" in sys.modules


def require_bpy():
    """Skips the test where PyPI's bpy is absent, without loading it into this process."""
    if importlib.util.find_spec("bpy") is None:
        pytest.skip("PyPI's bpy is not installed")


def in_blender(function):
    """The test function, run inside; its own parameters must be JSON, or the path `tmp_path`."""
    parameters = list(inspect.signature(function).parameters.values())

    def test(blender, **arguments):
        blender.call(inspect.getfile(function), function.__name__, arguments)

    functools.update_wrapper(test, function)
    del test.__wrapped__
    test.__signature__ = inspect.Signature(
        [
            inspect.Parameter("blender", inspect.Parameter.KEYWORD_ONLY),
            *(p.replace(kind=p.KEYWORD_ONLY) for p in parameters),
        ]
    )
    test.inside = function
    return test
