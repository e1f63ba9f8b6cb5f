# SPDX-License-Identifier: GPL-3.0-or-later
"""The batch without Blender: which files, what is done already, what became of a child; and the flags."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.programs.batches import FakeLaunch, batch, make_folders, statuses

from addon.commands.batch import flags, plan, run_batch
from addon.commands.children import Children, understand
from addon.commands.parser import parse, solve_settings
from addon.commands.record import Record, described
from addon.core.errors import UserError

OLDER = pytest.mark.skipif(sys.version_info >= (3, 13), reason="Python 3.13 takes a**b for a*b")


@pytest.fixture
def folders(tmp_path):
    return make_folders(tmp_path)


def test_files_are_found_by_suffix_pattern_and_depth(folders):
    assert [task.name for task in plan(batch(folders))] == ["a.obj", "b.ply", "c.STL"]
    assert [task.name for task in plan(batch(folders, "--recursive", "--pattern", "*.ply"))] == [
        "b.ply",
        "sub/d.ply",
    ]
    (item,) = plan(batch(folders, "--pattern", "a*", "--format", "blend"))
    assert item.target == folders / "out/a.blend"
    inside = plan(batch(folders, "--recursive", output="in/sub"))
    assert [task.name for task in inside] == ["a.obj", "b.ply", "c.STL"]  # results are no sources


@pytest.mark.parametrize(
    ("output", "further", "text"),
    [
        ("in", [], "would overwrite their sources"),
        ("in/a.obj", [], "is a file, not a folder"),
        ("out", ["--pattern", "*.txt"], "holds no .ply"),
        pytest.param("out", ["--pattern", "a**b"], "--pattern", marks=OLDER),
    ],
)
def test_what_cannot_be_planned_is_named(folders, output, further, text):
    with pytest.raises(UserError, match=text):
        plan(batch(folders, *further, output=output))


def test_two_sources_of_one_result_are_refused(folders):
    (folders / "in/a.ply").write_text("")
    with pytest.raises(UserError, match=r"a\.obj and a\.ply would both become"):
        plan(batch(folders, "--format", "stl"))


def test_one_failure_or_crash_stops_no_other_and_a_second_run_does_the_rest(folders, capsys):
    for name in ("dies.ply", "fails.ply"):
        (folders / "in" / name).write_text("")
    assert run_batch(batch(folders, "--jobs", "2"), FakeLaunch()) == 1
    out = folders / "out"
    assert statuses(out) == {
        "a.obj": "done",
        "b.ply": "done",
        "c.STL": "done",
        "dies.ply": "failed",
        "fails.ply": "failed",
    }
    assert (out / "a.obj").read_text() == "made"
    assert "ended by signal 11" in Record(out).entry("dies.ply")["message"]
    (folders / "in/dies.ply").rename(folders / "in/lives.ply")
    assert run_batch(batch(folders), FakeLaunch()) == 1
    assert "5 files: 1 done, 3 skipped, 1 failed" in capsys.readouterr().out
    (folders / "in/fails.ply").unlink()
    assert run_batch(batch(folders), FakeLaunch()) == 0


@pytest.mark.parametrize("change", ["option", "source", "result removed", "result older", "again", "none"])
def test_what_is_done_again(folders, change, capsys):
    run_batch(batch(folders), FakeLaunch())
    source, result, further = folders / "in/a.obj", folders / "out/a.obj", []
    if change == "option":
        further = ["--strength", "0.5"]
    elif change == "source":
        source.write_text("another content")
    elif change == "result removed":
        result.unlink()
    elif change == "result older":
        os.utime(result, ns=(0, source.stat().st_mtime_ns - 10**9))
    elif change == "again":
        further = ["--again"]
    capsys.readouterr()
    assert run_batch(batch(folders, *further), FakeLaunch()) == 0
    done = {"option": 3, "again": 3, "none": 0}.get(change, 1)
    assert f"3 files: {done} done, {3 - done} skipped" in capsys.readouterr().out


def test_a_dry_run_does_nothing(folders):
    assert run_batch(batch(folders, "--dry-run"), FakeLaunch()) == 0
    assert not (folders / "out").exists()


def test_a_file_that_takes_too_long_is_given_up(folders):
    (folders / "in/hangs.ply").write_text("")
    begin = time.monotonic()
    assert run_batch(batch(folders, "--pattern", "hangs*", "--limit", "0.5"), FakeLaunch()) == 1
    assert time.monotonic() - begin < 30
    assert "given up after 0.5 s" in Record(folders / "out").entry("hangs.ply")["message"]


def test_leaving_ends_the_children(tmp_path):
    with Children(dict(os.environ), None) as children:
        process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
        children.running.add(process)
    assert process.poll() is not None


def test_a_damaged_note_means_doing_that_file_anew(folders, capsys):
    assert run_batch(batch(folders), FakeLaunch()) == 0
    Record(folders / "out").place("b.ply").write_text("{")
    capsys.readouterr()
    assert run_batch(batch(folders), FakeLaunch()) == 0
    said = capsys.readouterr().out
    assert "b.ply.json is damaged" in said and "3 files: 1 done, 2 skipped" in said


def test_handles_count_by_their_content(tmp_path):
    one, two = tmp_path / "one.json", tmp_path / "two.json"
    one.write_text("[]")
    two.write_text("[]")
    same = described("deform", {"handles": one}, "1")
    assert same == described("deform", {"handles": two}, "1") != described("deform", {}, "1")
    two.write_text("[1]")
    assert described("deform", {"handles": two}, "1") != same


def test_flags_come_back_as_the_same_settings(folders):
    options = batch(folders, "--strength", "0.25", "--frame", "world", "--quality", "draft")
    settings = solve_settings(options)
    single = parse(["stylize", *flags(settings), "-i", "a.ply", "-o", "b.ply"])
    assert solve_settings(single) == settings
    deform = parse(["deform", "--no-exact-handles", "--handles", "p.json", "-i", "a.ply", "-o", "b.ply"])
    again = parse(["deform", *flags(solve_settings(deform)), "-i", "a.ply", "-o", "b.ply"])
    assert solve_settings(again) == {"exact_handles": False, "handles": Path("p.json").resolve()}


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["stylize", "-i", "a.ply", "-o", "b.ply", "--style", "banana"], "is no style"),
        (["stylize", "-i", "a.ply", "-o", "b.ply", "--strength", "2"], "not within 0.0 to 1.0"),
        (["batch", "-i", "a", "-o", "b"], "either --style NAME or --deform"),
        (["batch", "-i", "a", "-o", "b", "--style", "cube", "--deform"], "either"),
        (["batch", "-i", "a", "-o", "b", "--style", "cube", "--handles", "p"], "--handles"),
        (["batch", "-i", "a", "-o", "b", "--deform", "--strength", "1"], "no meaning for deform"),
        (["batch", "-i", "a", "-o", "b", "--style", "cube", "--jobs", "0"], "at least 1"),
        (["batch", "-i", "a", "-o", "b", "--style", "cube", "--pattern", "/etc/*"], "--pattern"),
        (["batch", "-i", "a", "-o", "b", "--style", "cube", "--pattern", "../*"], "--pattern"),
        (["batch", "-i", "a", "-o", "b", "--style", "cube", "--pattern", ""], "--pattern"),
        (["batch", "-i", "a", "-o", "b", "--style", "cube", "--limit", "nan"], "--limit"),
        (["batch", "-i", "a", "-o", "b", "--style", "cube", "--limit", "inf"], "--limit"),
        (["batch", "-i", "a", "-o", "b", "--style", "cube", "--limit", "-1"], "--limit"),
        (["bake", "-i", "a.blend", "--bogus"], "bake: unrecognized arguments: --bogus (see"),
    ],
)
def test_wrong_usage_is_one_line(arguments, text, capsys):
    with pytest.raises(SystemExit) as stop:
        parse(arguments)
    said = capsys.readouterr().err
    assert stop.value.code == 2 and text in said and len(said.splitlines()) == 1


def test_a_child_that_says_nothing_fails(tmp_path):
    assert understand(0, tmp_path / "none", "")["status"] == "failed"
