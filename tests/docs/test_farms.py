# SPDX-License-Identifier: GPL-3.0-or-later
"""The farm examples, with a stand-in for Blender: each of the schedulers that is installed runs them."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pages
import pytest
from support.geometry.meshes import sphere
from support.programs.batches import make_slow_inputs, starts, statuses

import arapfields as af
from arapfields.cli.handles import read_tracks

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "docs" / "examples" / "farm"
PROGRAM = f"{sys.executable} {ROOT / 'tests/support/programs/batches.py'}"
COUNT = 12


@pytest.fixture
def place(tmp_path):
    return make_slow_inputs(tmp_path, COUNT)


def run(*command, **environment):
    words = [str(word) for word in command]
    return subprocess.run(words, env={**os.environ, **environment}, capture_output=True, text=True)


def complete(place):
    assert set(statuses(place / "out").values()) == {"done"} and len(statuses(place / "out")) == COUNT
    return len(starts(place / "out"))


def part(place, number, program=PROGRAM):
    settings = {"SLURM_ARRAY_TASK_ID": str(number), "SLURM_ARRAY_TASK_MAX": "2", "PROGRAM": program}
    flags = ["--style", "cube", "-i", place / "in", "-o", place / "out"]
    return run("bash", EXAMPLES / "slurm.sh", *flags, **settings)


DIES_ONCE = """
import os, signal, sys
place = sys.argv[1]
if not os.path.exists(place):
    open(place, "w").close()
    os.kill(os.getpid(), signal.SIGKILL)
os.execv(sys.executable, [sys.executable, *sys.argv[2:]])
"""


def test_the_array_script_restarts_a_killed_part(place):
    (place / "dies.py").write_text(DIES_ONCE)
    program = (
        f"{sys.executable} {place / 'dies.py'} {place / 'mark'} {ROOT / 'tests/support/programs/batches.py'}"
    )
    first = part(place, 1, program)
    assert first.returncode == 0 and "part 1 ended with 137, attempt 1" in first.stderr, first
    assert len(statuses(place / "out")) == COUNT // 2
    assert part(place, 2).returncode == 0 and complete(place) == COUNT


def test_the_array_script_ends_as_the_batch_does(place):
    (place / "in/fails.ply").write_text("")
    assert {part(place, 1).returncode, part(place, 2).returncode} == {0, 1}
    assert "--array=1-N" in run("bash", EXAMPLES / "slurm.sh", SLURM_ARRAY_TASK_ID="1").stderr


@pytest.mark.slow
def test_slurm_runs_the_array(place):
    if not shutil.which("sbatch") or run("sinfo", "--noheader").returncode != 0:
        pytest.skip("no Slurm at work here (Debian: slurm-wlm, munge)")
    flags = ["--style", "cube", "-i", place / "in", "-o", place / "out"]
    array = ["sbatch", "--wait", "--array=1-3", f"--output={place}/log-%a"]
    done = run(*array, EXAMPLES / "slurm.sh", *flags, PROGRAM=PROGRAM)
    assert done.returncode == 0, done.stderr + "".join(p.read_text() for p in place.glob("log-*"))
    assert complete(place) == COUNT


@pytest.mark.slow
def test_openjd_runs_the_template(place):
    pytest.importorskip("openjd.cli", reason="openjd-cli is not installed")
    template = EXAMPLES / "openjd.yaml"
    tool = [sys.executable, "-m", "openjd"]
    checked = run(*tool, "check", template)
    assert checked.returncode == 0, checked
    given = {"Input": place / "in", "Output": place / "out", "Parts": 3, "Program": PROGRAM}
    words = [word for name, value in given.items() for word in ("-p", f"{name}={value}")]
    done = run(*tool, "run", template, "--step", "Batch", *words)
    assert done.returncode == 0, done.stdout[-3000:]
    assert complete(place) == COUNT


@pytest.mark.slow
def test_the_dask_example_runs(tmp_path):
    pytest.importorskip("distributed", reason="Dask is not installed")
    trimesh = pytest.importorskip("trimesh")
    (tmp_path / "in").mkdir()
    for i in range(3):
        vertices, triangles = sphere(1.0 + i, 2)
        trimesh.Trimesh(vertices, triangles, process=False).export(tmp_path / f"in/{i}.ply")
    (tmp_path / "in/broken.ply").write_text("ply")
    command = [sys.executable, EXAMPLES / "dask_styles.py", tmp_path / "in", tmp_path / "out"]
    first = run(*command)
    assert first.returncode == 1 and "broken.ply: FAILED" in first.stdout, first
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["0.ply", "1.ply", "2.ply"]
    (tmp_path / "in/broken.ply").unlink()
    second = run(*command)
    assert second.returncode == 0 and second.stdout == ""  # all there already


COMPILE = """
const tasks = [];
global.author = {
  Task: (name, kind) => ({ name, kind, commands: [], addCommand(c) { this.commands.push(c); } }),
  Command: (name, parameters) => ({ name, parameters }),
};
const source = require("fs").readFileSync(process.argv[2], "utf8") + "; [JOB_TYPE, compileJob]";
const [type, compile] = eval(source);
const settings = { program: "blender", input: "in", output: "out", flags: " --style  cube", parts: 3 };
compile({ settings, addTask: (task) => tasks.push(task) });
console.log(JSON.stringify({ keys: type.settings.map((s) => s.key), tasks }));
"""


def test_the_flamenco_job_type_makes_a_task_a_part(tmp_path):
    """By a stand-in for Flamenco's compiler."""
    if not shutil.which("node"):
        pytest.skip("no node")
    (tmp_path / "compile.js").write_text(COMPILE)
    done = run("node", tmp_path / "compile.js", EXAMPLES / "flamenco.js")
    made = json.loads(done.stdout)
    assert made["keys"] == ["program", "input", "output", "flags", "parts"]
    commands = [task["commands"][0]["parameters"] for task in made["tasks"]]
    expected = "--command arapfields batch -i in -o out --style cube --shard"
    assert [" ".join(c["args"]) for c in commands] == [f"{expected} {i}/3" for i in (1, 2, 3)]


def test_the_tracks_of_the_page_are_tracks(tmp_path):
    (text,) = [
        code for kind, code in pages.FENCE.findall((ROOT / "docs/animate.md").read_text()) if kind == "json"
    ]
    (tmp_path / "walk.json").write_text(text)
    tracks = read_tracks(tmp_path / "walk.json")
    assert (tracks.fps, tracks.start, tracks.count) == (24, 1, 2)
    feet, nose = tracks.handles(1, np.array([[-1.0] * 3, [1.0] * 3]))
    assert isinstance(feet, af.CuboidHandle) and np.array_equal(nose.target, [0, 0.4, 1])
