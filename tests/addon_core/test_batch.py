# SPDX-License-Identifier: GPL-3.0-or-later
"""Batches without Blender: which files, what is done already, several at once, killed ones, their notes."""

import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from support.programs.batches import FakeLaunch, batch, make_folders, make_slow_inputs, starts, statuses

from addon.commands.batch import Children, Record, described, differences, flags, plan, run_batch, understand
from addon.commands.parser import parse, solve_settings
from addon.core.errors import UserError

# The batch without Blender: which files, what is done already, what became of a child; and the flags.

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
def test_bad_batch_plans_are_named(folders, output, further, text):
    with pytest.raises(UserError, match=text):
        plan(batch(folders, *further, output=output))


def test_two_sources_of_one_result_are_refused(folders):
    (folders / "in/a.ply").write_text("")
    with pytest.raises(UserError, match=r"a\.obj and a\.ply would both become"):
        plan(batch(folders, "--format", "stl"))


def test_failures_stop_no_other_file_and_a_second_run_finishes(folders, capsys):
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
def test_changed_inputs_are_done_again(folders, change, capsys):
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


# What a batch notes beside other batches, damaged notes, and children whose parent is killed.

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
        "from addon.commands.batch import Record\n"
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
        "from addon.commands.batch import end_with_parent\n"
        "from addon.commands.batch import Record\n"
        "end_with_parent(); record = Record(sys.argv[1])\n"
        "while not record.claim(sys.argv[2]): time.sleep(0.01)\n"
        "time.sleep(600)\n"
    )
    parent = (
        f"import os, sys, threading; sys.path.insert(0, {str(ROOT)!r})\n"
        "from addon.commands.batch import Children\n"
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


# Parts of a batch, several batches at once and killed ones: complete, equal, each input done once.

COUNT = 60


@pytest.fixture
def many(tmp_path):
    return make_slow_inputs(tmp_path, COUNT)


def start(folder, *flags):
    where = ["--style", "cube", "-i", str(folder / "in"), "-o", str(folder / "out")]
    command = [sys.executable, str(ROOT / "tests/support/programs/batches.py"), *where, *flags]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def complete(folder):
    done = statuses(folder / "out")
    return len(done) == COUNT and set(done.values()) == {"done"}


@pytest.mark.parametrize("order", [(1, 2, 3, 4), (3, 1, 4, 2)])
def test_shards_in_any_order_cover_all_inputs(order, many, capsys):
    for number in order:
        assert run_batch(batch(many, "--shard", f"{number}/4", "--jobs", "4"), FakeLaunch()) == 0
        assert f"15 of 15 files to do, the part {number}/4 of 60" in capsys.readouterr().out
    assert complete(many) and starts(many / "out") == sorted(p.name for p in (many / "in").iterdir())
    assert run_batch(batch(many), FakeLaunch()) == 0
    assert "60 files: 0 done, 60 skipped" in capsys.readouterr().out


def test_several_writers_divide_the_work(many):
    running = [start(many, "--jobs", "2") for _ in range(3)]
    said = [process.communicate(timeout=300)[0] for process in running]
    assert [process.returncode for process in running] == [0, 0, 0], said
    assert complete(many) and len(starts(many / "out")) == COUNT  # each once


@pytest.mark.slow
def test_a_killed_batch_repeats_only_unfinished_inputs(many):
    """Killed at random moments, resumed: what was noted is never done again, nothing is left out."""
    choose = random.Random(0)
    for _ in range(4):
        two = [start(many, "--shard", f"{i}/2") for i in (1, 2)]
        time.sleep(choose.uniform(0.5, 2.5))
        for process in two:
            process.send_signal(choose.choice([signal.SIGKILL, signal.SIGTERM]))
        for process in two:
            process.communicate(timeout=60)
    noted = {name for name, status in statuses(many / "out").items() if status == "done"}
    before = Counter(starts(many / "out")) if noted else Counter()
    two = [start(many, "--shard", f"{i}/2") for i in (1, 2)]
    assert [process.communicate(timeout=300) and process.returncode for process in two] == [0, 0]
    after = Counter(starts(many / "out"))
    assert complete(many) and all(after[name] == before[name] for name in noted)


def test_inputs_abandoned_by_another_batch_are_done(many, capsys):
    """An input that another process has claimed is waited for, and done where that process ended without."""
    for path in sorted((many / "in").iterdir())[2:]:
        path.unlink()
    code = (
        f"import sys, time; sys.path.insert(0, {str(ROOT)!r})\n"
        "from addon.commands.batch import Record\n"
        "record = Record(sys.argv[1]); print(record.claim('slow00.ply'), flush=True); time.sleep(2)\n"
    )
    other = subprocess.Popen([sys.executable, "-c", code, many / "out"], stdout=subprocess.PIPE, text=True)
    assert other.stdout.readline() == "True\n"
    begin = time.monotonic()
    assert run_batch(batch(many), FakeLaunch()) == 0
    assert other.wait(60) == 0 and time.monotonic() - begin > 1.0
    said = capsys.readouterr().out
    assert said.index("slow01.ply: done") < said.index("slow00.ply: done") and "2 done, 0 skipped" in said


def test_parts_that_disagree_are_named(many, capsys):
    assert run_batch(batch(many, "--shard", "1/30"), FakeLaunch()) == 0
    with pytest.raises(UserError, match=r"results made with strength unset \(now 0\.5\)"):
        run_batch(batch(many, "--shard", "2/30", "--strength", "0.5"), FakeLaunch())
    record = Record(many / "out")
    record.agree({**record.settings(), "version": "0.0.1"}, anew=True)
    with pytest.raises(UserError, match=r"version 0\.0\.1 \(now "):
        run_batch(batch(many, "--shard", "2/30"), FakeLaunch())
    assert run_batch(batch(many, "--shard", "2/30", "--again"), FakeLaunch()) == 0
    assert run_batch(batch(many, "--shard", "3/30"), FakeLaunch()) == 0
    capsys.readouterr()
    assert run_batch(batch(many, "--pattern", "slow0*", "--strength", "0.5"), FakeLaunch()) == 0
    assert "holds results made with strength unset (now 0.5); those are done anew" in capsys.readouterr().out


def test_a_part_may_be_empty(many, capsys):
    assert run_batch(batch(many, "--shard", "70/70"), FakeLaunch()) == 0
    assert "0 of 0 files to do, the part 70/70 of 60" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["0/4", "5/4", "1", "1/0", "-1/4", "a/b", "1/2/3"])
def test_bad_shards_are_refused(text, many, capsys):
    with pytest.raises(SystemExit):
        batch(many, "--shard", text)
    assert "--shard" in capsys.readouterr().err
