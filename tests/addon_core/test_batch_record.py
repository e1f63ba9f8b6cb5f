# SPDX-License-Identifier: GPL-3.0-or-later
"""What a batch notes beside other batches, damaged notes, and children whose parent is killed."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from addon.commands.children import understand
from addon.commands.record import Record, differences

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("text", ["[]", '{"format": 2', "[" * 100000, '{"format": 1}', "\x00\xff", ""])
def test_notes_of_any_content_are_read(text, tmp_path):
    record = Record(tmp_path)
    record.note("a.ply", status="done")
    assert record.entry("a.ply")["status"] == "done" and not record.is_damaged("a.ply")
    record.place("a.ply").write_text(text)
    assert record.entry("a.ply") == {} and record.is_damaged("a.ply")
    record.note("a.ply", status="done")
    assert record.entry("a.ply")["status"] == "done"


def test_names_of_any_length_and_letters_are_noted(tmp_path):
    record = Record(tmp_path)
    odd = ["a\udcff.ply"] if os.name == "posix" else []  # Windows' names are Unicode
    for name in ("é" * 123 + ".ply", "sub/" + "x" * 250 + ".ply", "sub/deep/a.obj", *odd):
        record.note(name, status="done")
        assert Record(tmp_path).entry(name)["status"] == "done"
        assert record.claim(name)
        record.release(name)


def test_an_input_is_claimed_by_one_process_until_it_ends(tmp_path):
    code = (
        f"import sys, time; sys.path.insert(0, {str(ROOT)!r})\n"
        "from addon.commands.record import Record\n"
        "record = Record(sys.argv[1]); print(record.claim('a.ply'), flush=True); time.sleep(60)\n"
    )
    other = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    record = Record(tmp_path)
    try:
        assert other.stdout.readline() == "True\n"
        assert not record.claim("a.ply") and record.claim("b.ply")
        other.kill()
        other.wait()
        assert record.claim("a.ply")
    finally:
        other.kill()
        record.close()


def test_differences_are_named():
    then, now = {"version": "1", "verb": "stylize", "strength": 0.5}, {"version": "2", "verb": "stylize"}
    assert differences(then, now) == "strength 0.5 (now unset), version 1 (now 2)"


def test_children_end_with_a_parent_that_is_killed(tmp_path):
    """Two at once: each holds a lock for as long as it lives."""
    child = (
        f"import sys, time; sys.path.insert(0, {str(ROOT)!r})\n"
        "from addon.commands.launch import end_with_parent\n"
        "from addon.commands.record import Record\n"
        "end_with_parent(); record = Record(sys.argv[1])\n"
        "while not record.claim(sys.argv[2]): time.sleep(0.01)\n"
        "time.sleep(600)\n"
    )
    parent = (
        f"import os, sys, threading; sys.path.insert(0, {str(ROOT)!r})\n"
        "from addon.commands.children import Children\n"
        "with Children(dict(os.environ), None) as children:\n"
        f"    command = [sys.executable, '-c', {child!r}, sys.argv[1]]\n"
        "    for name in ('a', 'b'):\n"
        "        threading.Thread(target=children.run, args=([*command, name],)).start()\n"
        "    sys.stdin.read()\n"
    )
    command = [sys.executable, "-c", parent, str(tmp_path)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE)
    record = Record(tmp_path)

    def held():
        free = [name for name in ("a", "b") if record.claim(name)]
        for name in free:
            record.release(name)
        return 2 - len(free)

    wait_for(lambda: held() == 2)
    process.kill()
    process.communicate()
    wait_for(lambda: held() == 0)


def wait_for(condition, seconds=30.0):
    begin = time.monotonic()
    while not condition():
        assert time.monotonic() - begin < seconds
        time.sleep(0.1)


@pytest.mark.parametrize(
    "objects", ["", "{", '{"objects": 3}', '{"objects": [3]}', '{"objects": [{}]}', "[]"]
)
def test_damaged_reports_of_children_are_failures(objects, tmp_path):
    report = tmp_path / "report.json"
    report.write_text(objects)
    assert understand(0, report, "")["status"] == "failed"
