# SPDX-License-Identifier: GPL-3.0-or-later
"""ImplicitFunction, written in Python: what does not fit is named."""

import numpy as np
import pytest

import arapfields as af


class Ball(af.ImplicitFunction):
    def __call__(self, points):
        return np.linalg.norm(points, axis=1) - 0.5


@pytest.mark.parametrize(
    "returned, word",
    [
        (lambda p: None, "NoneType"),
        (lambda p: p, "shape"),
        (lambda p: np.zeros(3), "3 values"),
        (lambda p: np.full(len(p), np.nan), "NaN"),
        (lambda p: ["x"] * len(p), "dtype"),
    ],
)
def test_results_that_do_not_fit_are_named(returned, word):
    class Odd(af.ImplicitFunction):
        def __call__(self, points):
            return returned(points)

    with pytest.raises(af.InvalidInput, match=f"^sdf: .*{word}"):
        af.extract_surface(Odd(), 32)


@pytest.mark.parametrize("bound", [1.0, np.float32(2.0), None])
def test_a_bound_on_the_gradient_is_taken(bound):
    class Bounded(Ball):
        gradient_bound = bound

    assert np.array_equal(af.extract_surface(Bounded(), 48).vertices, af.extract_surface(Ball(), 48).vertices)


@pytest.mark.parametrize("bound", [0.0, -1.0, np.nan, "steep", [1.0, 2.0]])
def test_a_bound_that_is_none_is_named(bound):
    class Bounded(Ball):
        gradient_bound = bound

    with pytest.raises(af.InvalidInput, match=r"^sdf\.gradient_bound"):
        af.extract_surface(Bounded(), 48)


def test_gradients_that_do_not_fit_are_named():
    class Odd(Ball):
        def gradient(self, points):
            return points[:5]

    with pytest.raises(af.InvalidInput, match=r"^sdf: 5 gradients"):
        af.sample_surface(Odd(), 100)


def test_a_subclass_without_a_function_says_so():
    class Nothing(af.ImplicitFunction):
        pass

    with pytest.raises(NotImplementedError, match=r"Nothing.*__call__"):
        af.extract_surface(Nothing(), 32)
    with pytest.raises(NotImplementedError):
        af.ImplicitFunction()(np.zeros((1, 3)))


def test_a_subclass_that_forgets_its_base_is_refused():
    class Forgets(af.ImplicitFunction):
        def __init__(self):
            pass

    with pytest.raises(TypeError, match="__init__"):
        Forgets()


@pytest.mark.parametrize("wrong", [None, 5, lambda p: p])
def test_what_is_no_function_is_refused(wrong):
    with pytest.raises((af.InvalidInput, TypeError), match=r"sdf|incompatible"):
        af.sample_surface(wrong)
    with pytest.raises((af.InvalidInput, TypeError)):
        af.extract_surface(wrong)
