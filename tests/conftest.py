# SPDX-License-Identifier: GPL-3.0-or-later
"""What every test may use: the folder of real data, and the helper modules beside this file."""

import gc
import os
import signal
from pathlib import Path

import pytest

gc.disable()  # until all tests are there: of what is imported nothing goes
ROOT = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get("ARAPFIELDS_DATA", ROOT.parent / "shared" / "data"))


# Of libtorch itself, its version and its threads: these run where the library is built with it.
TORCH_ALONE = (
    "tests/packaging/test_libtorch_version.py",
    "tests/python/test_threads.py::test_calls_at_once_have_their_own_numbers_and_torch_keeps_its",
)
LONG_FIRST = ("docs", "packaging", "native", "blender", "python", "fuzz", "architecture", "addon_core")


def deselect_those_of_torch(config, items):
    try:
        from arapfields import backend
    except ImportError:  # not built: tests of files alone run
        return
    if backend() == "eigen":
        others = [item for item in items if item.nodeid.startswith(TORCH_ALONE)]
        config.hook.pytest_deselected(items=others)
        items[:] = [item for item in items if item not in others]


def pytest_collection_modifyitems(config, items):
    """Folders with long files first: processes that take files one by one then end at about the same time."""
    items.sort(key=lambda item: LONG_FIRST.index(item.path.relative_to(ROOT / "tests").parts[0]))
    deselect_those_of_torch(config, items)


def pytest_collection_finish():
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True, scope="session")
def interrupts():
    """Python's own handler: a shell that runs the tests in the background has them ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def data_dir():
    """Published neural SDFs and meshes; tests that need them skip where they are absent."""
    if not DATA.is_dir():
        pytest.skip(f"no data at {DATA} (set ARAPFIELDS_DATA)")
    return DATA
