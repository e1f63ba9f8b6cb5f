# SPDX-License-Identifier: GPL-3.0-or-later
"""What a batch notes beside other batches, damaged notes, and children whose parent is killed."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from addon.commands.batch import understand
from addon.commands.record import NAME, Record

ROOT = Path(__file__).resolve().parents[2]


def statuses(folder):
    return {n: e["status"] for n, e in json.loads((folder / NAME).read_text())["files"].items()}


@pytest.mark.parametrize(
    "text", ["[]", '{"version": 1, "files": 3}', "[" * 100000, '{"version": 2}', "\x00\xff"]
)
def test_records_of_any_content_are_read(text, tmp_path):
    (tmp_path / NAME).write_text(text)
    record = Record(tmp_path)
    assert record.damaged and record.entries == {}
    record.note("a.ply", status="done")
    assert Record(tmp_path).entries == {"a.ply": {"status": "done"}}


def test_batches_that_share_a_folder_keep_each_others_notes(tmp_path):
    one, two = Record(tmp_path), Record(tmp_path)
    one.note("a.ply", status="done")
    two.note("b.ply", status="done")
    assert statuses(tmp_path) == {"a.ply": "done", "b.ply": "done"}
    code = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
        "from addon.commands.record import Record\n"
        "record = Record(sys.argv[1])\n"
        "for i in range(10): record.note(f'{sys.argv[2]}-{i}.ply', status='done')\n"
    )
    running = [subprocess.Popen([sys.executable, "-c", code, str(tmp_path), str(k)]) for k in range(3)]
    assert [process.wait(60) for process in running] == [0, 0, 0]
    assert len(statuses(tmp_path)) == 2 + 3 * 10
    assert [path.name for path in tmp_path.iterdir()] == [NAME]


def test_children_end_with_a_parent_that_is_killed(tmp_path):
    child = (
        f"import os, sys, time; sys.path.insert(0, {str(ROOT)!r})\n"
        "from addon.commands.launch import end_with_parent\n"
        "end_with_parent(); open(sys.argv[1], 'w').write(str(os.getpid())); time.sleep(60)\n"
    )
    parent = (
        f"import os, sys; sys.path.insert(0, {str(ROOT)!r})\n"
        "from addon.commands.batch import Children\n"
        "with Children(dict(os.environ), None) as children:\n"
        f"    children.run([sys.executable, '-c', {child!r}, sys.argv[1]])\n"
    )
    note = tmp_path / "pid"
    process = subprocess.Popen([sys.executable, "-c", parent, str(note)])
    wait_for(lambda: note.exists() and note.read_text())
    process.kill()
    process.wait()
    wait_for(lambda: not Path(f"/proc/{note.read_text()}").exists())


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
