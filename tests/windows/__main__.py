# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the tests of Python in a Windows Python and its bpy, under Wine, with the wheel and zip for Windows.

python -m tests.windows DIST [--python 3.11] [--jobs N] [FILE …]

A folder's files run in one process, which is restarted at a file that ends it, and after it the second time:
under Wine, a file may never open. Such ends are named. Prints the numbers of tests
that passed, failed and did not run by folder, with reasons. Exit code 1 if a test fails, or too few run.
"""

import argparse
import collections
import concurrent.futures
import json
import os
import shutil
import sys
from pathlib import Path

from . import environment
from .environment import ROOT, WORK

FOLDERS = ("tests/python", "tests/blender", "tests/addon_core")
LEAST = 0.95  # least share of a folder's tests that run and pass
DATA = Path(os.environ.get("ARAPFIELDS_DATA", ROOT.parent / "shared/data"))
# faulthandler reports exceptions that Wine handles as crashes.
OPTIONS = ["-q", "--continue-on-collection-errors", "-p", "no:cacheprovider", "-p", "no:faulthandler"]
OPTIONS += ["-p", "windows.plugin", "--color=no", "-m", "not slow"]


def outcomes(file):
    """{test: (outcome, reason)} from the plugin's file."""
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    return {name: (outcome, why) for name, outcome, why in map(json.loads, lines)}


def test(folder, name, files, reports):
    """Outcomes of a folder's files, which are relative paths."""
    kept, log = reports / f"{name.replace('/', '-')}.jsonl", reports / f"{name.replace('/', '-')}.log"
    kept.unlink(missing_ok=True)
    given = {"ARAPFIELDS_OUTCOMES": environment.windows(kept)}
    given |= {"ARAPFIELDS_DATA": environment.windows(DATA)} if DATA.is_dir() else {}
    said, ended = "", set()
    while files:
        done = environment.run(folder, "-m", "pytest", *OPTIONS, *files, **given)
        said += done.stdout
        log.write_text(said, encoding="utf-8")
        found = outcomes(kept)
        name_of_last, (outcome, _) = list(found.items())[-1] if found else (files[0], ("", ""))
        if done.returncode in (0, 1, 5) and outcome != "begun":
            return found
        last = name_of_last.partition("::")[0]
        if last not in files:
            return found | {name: ("failed", f"status {done.returncode}: {done.stdout[-400:]}")}
        print(f"the process ended in {name_of_last}: status {done.returncode}", flush=True)
        files = files[files.index(last) + (last in ended) :]
        ended.add(last)
    return found


def extension(folder, zip_file):
    """Whether the zip can be used, removed and upgraded while its library is loaded, for any user name."""
    user, support = WORK / "Jörg 用户 x/Blender", ROOT / "tests/support/blender"
    shutil.rmtree(user, ignore_errors=True)
    user.mkdir(parents=True)
    zip_file, used = environment.windows(zip_file), "upgraded.py"
    for script, order in (("installed.py", zip_file), (used, "gone"), (used, zip_file), (used, "used")):
        given = {"BLENDER_USER_RESOURCES": environment.windows(user), "OMP_NUM_THREADS": "1"}
        done = environment.run(folder, environment.windows(support / script), order, **given)
        print(f"extension: {script} {order}: {'failed' if done.returncode else 'passed'}", flush=True)
        if done.returncode:
            print(done.stdout[-3000:])
            return False
    return True


def table(results):
    """Prints numbers by folder; returns whether all tests passed and enough ran."""
    good = True
    print(f"{'folder':18}{'tests':>7}{'passed':>8}{'failed':>8}{'not run':>9}")
    for folder, found in sorted(results.items()):
        kinds = collections.Counter(outcome for outcome, _ in found.values())
        failed, total = kinds["failed"] + kinds["begun"], sum(kinds.values())
        good &= not failed and kinds["passed"] >= LEAST * total > 0
        print(f"{folder:18}{total:7}{kinds['passed']:8}{failed:8}{kinds['skipped']:9}")
    for outcome, title in (("skipped", "not run"), ("failed", "failed"), ("begun", "failed")):
        for found in results.values():
            for name, (did, why) in found.items():
                if did == outcome:
                    print(f"{title}: {name}: {why.strip()[-300:]}")
    return good


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dist", type=Path, help="folder with the wheels and the zip")
    parser.add_argument("--python", default="3.11", choices=environment.EMBEDDED)
    parser.add_argument("--jobs", type=int, default=2, help="folders at a time")
    parser.add_argument("files", nargs="*", type=Path, help="files of tests instead of all")
    given = parser.parse_intermixed_args()
    folder = environment.python(given.python)
    (wheel,) = given.dist.glob(f"arapfields-*cp{given.python.replace('.', '')}*win_amd64.whl")
    environment.install(wheel, folder)
    reports = WORK / f"reports-{given.python}"
    reports.mkdir(exist_ok=True)
    files = collections.defaultdict(list)
    for path in given.files or [path for name in FOLDERS for path in sorted((ROOT / name).glob("test_*.py"))]:
        path = path.resolve().relative_to(ROOT)
        files[str(path.parent)].append(path.as_posix())
    with concurrent.futures.ThreadPoolExecutor(given.jobs) as pool:
        runs = {name: pool.submit(test, folder, name, files[name], reports) for name in files}
        results = {name: run.result() for name, run in runs.items()}
    good = table(results)
    if not given.files:
        (zip_file,) = given.dist.resolve().glob("arapfields-*-windows-x64.zip")
        good &= extension(folder, zip_file)
    environment.end_all()
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
