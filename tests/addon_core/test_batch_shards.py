# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a batch, several batches at once and killed ones: complete, equal, each input done once."""

import random
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from support.programs.batches import FakeLaunch, batch, starts, statuses

from addon.commands.batch import run_batch
from addon.commands.record import Record
from addon.core.errors import UserError

ROOT = Path(__file__).resolve().parents[2]
COUNT = 60


@pytest.fixture
def many(tmp_path):
    (tmp_path / "in").mkdir()
    for i in range(COUNT):
        (tmp_path / f"in/slow{i:02d}.ply").write_text(str(i))
    return tmp_path


def start(folder, *flags):
    where = ["--style", "cube", "-i", str(folder / "in"), "-o", str(folder / "out")]
    command = [sys.executable, str(ROOT / "tests/support/programs/batches.py"), *where, *flags]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def complete(folder):
    done = statuses(folder / "out")
    return len(done) == COUNT and set(done.values()) == {"done"}


@pytest.mark.parametrize("order", [(1, 2, 3, 4), (3, 1, 4, 2)])
def test_parts_in_any_order_are_the_whole(order, many, capsys):
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
def test_kills_in_between_cost_nothing_but_what_was_at_work(many):
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


def test_what_another_batch_leaves_undone_is_done(many, capsys):
    """An input that another process has claimed is waited for, and done where that process ended without."""
    for path in sorted((many / "in").iterdir())[2:]:
        path.unlink()
    code = (
        f"import sys, time; sys.path.insert(0, {str(ROOT)!r})\n"
        "from addon.commands.record import Record\n"
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
def test_no_part_of_a_whole(text, many, capsys):
    with pytest.raises(SystemExit):
        batch(many, "--shard", text)
    assert "--shard" in capsys.readouterr().err
