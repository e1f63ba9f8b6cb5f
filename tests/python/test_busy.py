# SPDX-License-Identifier: GPL-3.0-or-later
"""Beside as many busy processes as there are processors, a call takes little more than twice as long."""

import importlib.util
from pathlib import Path

import pytest
from support.tolerances import BUSY_SLOWDOWN

BENCHMARK = Path(__file__).parents[1] / "benchmarks" / "busy.py"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["deform", "live"])
@pytest.mark.parametrize("first", ["torch", "arapfields"])
def test_other_processes_cost_their_share_alone(name, first):
    spec = importlib.util.spec_from_file_location("busy", BENCHMARK)
    busy = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(busy)
    *_, ratio = busy.slowdown(name, first)
    assert ratio <= BUSY_SLOWDOWN
