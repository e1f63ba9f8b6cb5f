# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape that tests of wraps and of their landmarks share."""

import pytest
from support.geometry import wrap_cases as cases

import arapfields as af


@pytest.fixture(scope="module")
def figure():
    return cases.figure(3)


@pytest.fixture(scope="module")
def samples(figure):
    return af.sample_mesh(*figure, 1500)
