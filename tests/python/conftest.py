# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures of several files: shapes and landmarks of wraps, and saved fields."""

import pytest
from support.files import archives
from support.geometry import wrap_cases as cases

import arapfields as af


@pytest.fixture(scope="module")
def figure():
    return cases.figure(3)


@pytest.fixture(scope="module")
def samples(figure):
    return af.sample_mesh(*figure, 1500)


@pytest.fixture(scope="session")
def examples(tmp_path_factory):
    """{kind: path} of saved fields and signed distances, read-only."""
    return archives.make_examples(tmp_path_factory.mktemp("examples"))
