# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures of all tests: the folder of published data, and the path of the helper modules."""

import gc
import os
import signal
from pathlib import Path

import pytest

gc.disable()  # until all tests are collected: imported objects stay anyway
ROOT = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get("ARAPFIELDS_DATA", ROOT.parent / "shared" / "data"))


# Tests of libtorch, its version and its threads: only for a library built with it.
TORCH_ALONE = (
    "tests/packaging/test_pip.py::test_the_package_records_its_libtorch_version",
    "tests/packaging/test_pip.py::test_another_version_is_named",
    "tests/packaging/test_pip.py::test_a_missing_torch_is_named",
    "tests/packaging/test_pip.py::test_import_ends_with_that_line",
    "tests/python/test_threads.py::test_concurrent_calls_keep_their_thread_counts",
)
SLOW_PARTS = 10  # of the slow tests, each some minutes on two processors
LONG_FIRST = ("docs", "packaging", "native", "blender", "python", "fuzz", "architecture", "addon_core")


def deselect_those_of_torch(config, items):
    try:
        from arapfields import backend
    except ImportError:  # not built: only tests of files run
        return
    if backend() == "eigen":
        others = [item for item in items if item.nodeid.startswith(TORCH_ALONE)]
        config.hook.pytest_deselected(items=others)
        items[:] = [item for item in items if item not in others]


def pytest_addoption(parser):
    text = f"one of {SLOW_PARTS} parts of the slow tests: all of them in turn as the number rises"
    parser.addoption("--slow-part", type=int, metavar="NUMBER", help=text)


def select_slow_part(config, items, number):
    slow = [item for item in items if item.get_closest_marker("slow")]
    chosen = set(slow[number % SLOW_PARTS :: SLOW_PARTS])
    config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
    items[:] = [item for item in items if item in chosen]


def pytest_collection_modifyitems(config, items):
    """Sorts folders with slow files first, so that parallel processes end at about the same time."""
    items.sort(key=lambda item: LONG_FIRST.index(item.path.relative_to(ROOT / "tests").parts[0]))
    deselect_those_of_torch(config, items)
    if (number := config.getoption("--slow-part")) is not None:
        select_slow_part(config, items, number)


def pytest_collection_finish():
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True, scope="session")
def interrupts():
    """Restores Python's handler of Ctrl-C, which background jobs of a shell ignore."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def data_dir():
    """Folder of published neural SDFs and meshes; skips the test if it is missing."""
    if not DATA.is_dir():
        pytest.skip(f"no data at {DATA} (set ARAPFIELDS_DATA)")
    return DATA
