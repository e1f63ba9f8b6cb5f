# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs cases of one target: `python -m tests.fuzz.worker TARGET SEED FIRST COUNT`.

Prints a line before each case, and one with its outcome.
"""

import contextlib
import json
import os
import resource
import signal
import sys
import tempfile
import traceback
import zlib
from functools import partial
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

MEMORY = 2 << 30  # bytes that a case may allocate
PATIENCE = 2.0  # seconds after which a call is interrupted, as by Ctrl-C


class Late(Exception):
    """Raised by the alarm."""


def interrupt(*_):
    raise Late


def limit_memory():
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


@contextlib.contextmanager
def only_errors(documented):
    """Context manager: a dict with the outcome: "ok", "refused" with the error's text, or "failed"."""
    outcome = {"outcome": "ok"}
    try:
        yield outcome
    except Late:
        outcome["outcome"] = "late"
    except documented as error:
        outcome |= {"outcome": "refused", "text": f"{type(error).__name__}: {error}"[:2000]}
    except BaseException:
        outcome |= {"outcome": "failed", "text": traceback.format_exc(limit=-6)[-3000:]}


def run_files(target, seed, first, count, say):
    from tests.fuzz.files import TARGETS

    with tempfile.TemporaryDirectory() as folder:
        net = TARGETS[target](folder)
        limit_memory()
        for number in range(first, first + count):
            rng = np.random.default_rng([seed, zlib.crc32(target.encode()), number])
            path = net.case(rng)
            say(number)
            with only_errors(net.documented) as outcome, np.errstate(all="ignore"):
                net.use(path)
            nameless = outcome["outcome"] == "refused" and path.name not in outcome["text"]
            if nameless and target != "commandline":
                outcome |= {"outcome": "failed", "text": "the file is not named: " + outcome["text"]}
            say(outcome)


def run_api(seed, first, count, say):
    import arapfields as af
    from tests.fuzz import calls
    from tests.fuzz.calls import make_things

    documented = (af.InvalidInput, OSError, af.Cancelled, af.Diverged, TypeError)
    limit_memory()
    signal.signal(signal.SIGALRM, interrupt)
    for number in range(first, first + count):
        rng = np.random.default_rng([seed, 1, number])
        things = make_things() if number == first else things  # noqa: F821
        with only_errors(documented) as outcome, np.errstate(all="ignore"):
            name, function, arguments = calls.case(rng, things)
            say(number)
            signal.setitimer(signal.ITIMER_REAL, PATIENCE)
            try:
                function(*arguments)
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0)
            outcome["name"] = name
        say(outcome)


def main():
    target, seed, first, count = sys.argv[1], *map(int, sys.argv[2:5])
    lines = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # separates the targets' output

    def say(what):
        print(json.dumps(what), file=lines)

    run = run_api if target == "api" else partial(run_files, target)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):  # invalid paths may be written to
        run(seed, first, count, say)


if __name__ == "__main__":
    main()
