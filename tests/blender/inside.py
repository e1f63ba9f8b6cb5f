# SPDX-License-Identifier: GPL-3.0-or-later
"""@in_blender: the test's body runs in the Blender worker, its outcome is pytest's."""

import functools
import inspect


def in_blender(function):
    """The test function, run inside; its own parameters (of parametrize) must be JSON."""
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
