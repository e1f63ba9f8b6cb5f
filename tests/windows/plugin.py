# SPDX-License-Identifier: GPL-3.0-or-later
"""Pytest plugin in the Windows Python: skips tests that cannot run there, and writes outcomes at once."""

import ctypes
import faulthandler
import json
import os
import sys

import pytest

# Tests that cannot run in a Windows Python under Wine 8: {start of the name: reason}.

LIMITS = "Python on Windows cannot limit a process's memory, nor the size of its files"
CTRL_C = "Windows sends Ctrl-C to the processes of a console, and there is none"
KINDS = "on Windows pipes, sockets and devices are no files"
USD = "usd-core's libraries do not load beside bpy's under Wine"
OPEN = "Windows removes no open file"
PROC = "it looks into /proc, which Windows lacks"
LINKS = "Wine makes no symbolic links"
BACKWARD = "PyTorch's backward pass ends with an exception of its own under Wine"

PYTHON = {
    "test_arguments.py::test_objects_without_init_are_refused": LIMITS,
    "test_arguments.py::test_none_is_refused_as_an_object": LIMITS,
    "test_arguments.py::test_arrays_that_cannot_be_copied_are_named": LIMITS,
    "test_arguments.py::test_sizes_that_memory_cannot_hold_are_named": LIMITS,
    "test_arguments.py::test_a_sparse_file_asks_for_no_memory": LIMITS,
    "test_arguments.py::test_no_argument_asks_for_memory_that_is_not_there": LIMITS,
    "test_animate.py::test_a_disk_that_is_full_for_usd_is_named": LIMITS,
    "test_files.py::test_a_full_disk_is_named_and_changes_nothing": LIMITS,
    "test_files.py::test_verbs_on_a_full_disk": LIMITS,
    "test_point_cache.py::test_memory_does_not_grow_with_the_frames": LIMITS,
    "test_point_cache.py::test_a_disk_that_fills_meanwhile_is_named": LIMITS,
    "test_tasks.py::test_ctrl_c": CTRL_C,
    "test_cli.py::test_interrupt_cancels_and_leaves_nothing": CTRL_C,
    "test_files.py::test_only_regular_files_are_written[pipe]": KINDS,
    "test_files.py::test_only_regular_files_are_written[device]": KINDS,
    "test_files.py::test_only_regular_files_are_written[socket]": KINDS,
    "test_files.py::test_links_are_followed_and_permissions_stay": LINKS,
    "test_files.py::test_two_outputs_need_two_files": LINKS,
    "test_cli.py::test_a_progress_bar_is_drawn_only_on_a_terminal": "Windows has no pseudo-terminals",
    "test_point_cache.py::test_a_folder_that_goes_while_it_is_written_to_is_named": OPEN,
    "test_threads.py::test_no_thread_of_another_s_is_started": PROC,
    "test_threads.py::test_after_a_call_torch_still_uses_its_threads": PROC,
    "test_threads.py::test_threads_that_the_system_refuses_are_done_without": LIMITS,
    "test_networks.py::test_jets_and_parameter_gradients_equal_autograd": BACKWARD,
    "test_invertible.py::test_jets_and_pull_back_equal_autograd": BACKWARD,
}
BLENDER = {
    "test_commands.py::test_a_full_disk_is_named_and_changes_nothing": LIMITS,
    "test_bake.py::test_whatever_goes_wrong_is_named_and_the_last_good_cache_stays": LIMITS,
    "test_export.py": USD,
    "test_extension.py": "it starts Blenders of this system",
    "test_commands.py::test_ctrl_c_leaves_no_partial_file": CTRL_C,
    "test_commands.py::test_a_batch_that_is_killed_takes_its_blenders_along": PROC,
}
CORE = {
    "test_batch.py::test_failures_stop_no_other_file_and_a_second_run_finishes": "signals end none there",
}
NOT_RUN = {f"tests/python/{name}": why for name, why in PYTHON.items()}
NOT_RUN |= {f"tests/blender/{name}": why for name, why in BLENDER.items()}
NOT_RUN |= {f"tests/addon_core/{name}": why for name, why in CORE.items()}


# Pytest plugin in the Windows Python: skips the tests of not_run.py, and writes outcomes at once.

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
