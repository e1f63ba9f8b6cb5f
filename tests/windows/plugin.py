# SPDX-License-Identifier: GPL-3.0-or-later
"""pytest's plugin in the Windows Python: leaves out what not_run.py lists, keeps outcomes as they come."""

import json
import os

import pytest

from .not_run import NOT_RUN


def pytest_collection_modifyitems(items):
    for item in items:
        reason = next((why for name, why in NOT_RUN.items() if item.nodeid.startswith(name)), "")
        if reason:
            item.add_marker(pytest.mark.skip(reason=reason))


def keep(name, outcome, why):
    """Of a test's three parts a later one that does not pass counts."""
    with open(os.environ["ARAPFIELDS_OUTCOMES"], "a", encoding="utf-8") as file:
        file.write(json.dumps([name, outcome, why]) + "\n")


def pytest_runtest_logstart(nodeid):
    keep(nodeid, "begun", "the process ended in it")


def pytest_runtest_logreport(report):
    if report.when == "call" or report.outcome != "passed":
        why = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr or "")
        keep(report.nodeid, report.outcome, why)


def pytest_collectreport(report):
    if report.outcome != "passed":
        why = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr or "")
        keep(report.nodeid, report.outcome, why)
