# SPDX-License-Identifier: GPL-3.0-or-later
"""Pytest plugin in the Windows Python: skips the tests of not_run.py, and writes outcomes at once."""

import ctypes
import faulthandler
import json
import os
import sys

import pytest

from .not_run import NOT_RUN

STATUS = pytest.StashKey()
SECONDS = 600  # time limit of a test; then the process prints its stack and ends


def pytest_collection_modifyitems(items):
    for item in items:
        reason = next((why for name, why in NOT_RUN.items() if item.nodeid.startswith(name)), "")
        if reason:
            item.add_marker(pytest.mark.skip(reason=reason))


def keep(name, outcome, why):
    """Appends an outcome to the file; the last one of a test counts."""
    with open(os.environ["ARAPFIELDS_OUTCOMES"], "a", encoding="utf-8") as file:
        file.write(json.dumps([name, outcome, why]) + "\n")


def pytest_runtest_logstart(nodeid):
    keep(nodeid, "begun", "the process ended in it")
    faulthandler.dump_traceback_later(SECONDS, exit=True, file=sys.__stderr__)


def pytest_runtest_logreport(report):
    if report.when == "call" or report.outcome != "passed":
        why = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr or "")
        keep(report.nodeid, report.outcome, why)


def pytest_collectreport(report):
    if report.outcome != "passed":
        why = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr or "")
        keep(report.nodeid, report.outcome, why)


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session, exitstatus):
    session.config.stash[STATUS] = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    """Ends the process at once: under Wine, unloading of libtorch's libraries would hang."""
    sys.stdout.flush()
    sys.stderr.flush()
    ctypes.windll.kernel32.TerminateProcess(ctypes.c_void_p(-1), config.stash.get(STATUS, 1))
