# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost under conditions: the backend, a busy machine, the size of the problem."""

import functools
import json
import os
import statistics
import subprocess
import sys

import numpy as np

import arapfields as af

from . import shapes
from .shapes import Clock, deformer, once, targets

# Backends: the same work by Eigen and by libtorch in turn, on two threads (make build BACKEND=eigen).

SITE = shapes.ROOT / "build/eigen/site"
ROUNDS = 3
COLUMNS = ("Eigen, processor s", "libtorch, processor s", "Eigen over libtorch")
DRAG = range(0, shapes.FULL + 1, 2)


@functools.cache
def live(name):
    solver = deformer(name)
    solver.solve(targets(name, 0))
    return solver


def drag(name):
    """Live steps of a drag there and back."""
    live(name).reset()
    for degrees in [*DRAG, *reversed(DRAG)]:
        live(name).solve(targets(name, degrees))


def deform(name, **options):
    af.deform(shapes.samples(name), shapes.handles(name, shapes.FULL), af.DeformOptions(**options))


def neural(batch):
    """Iterations of a network with `batch` samples."""
    deform("bunny", field="neural", batch=batch, iterations=max(4, 12000 // batch))


def wrap():
    (vertices, triangles), target = shapes.own_mesh("dog"), shapes.own_mesh("lizard")
    af.wrap(af.sample_mesh(vertices, triangles), af.MeshSdf(*target), [], af.WrapOptions(iterations=12))


WORK = {  # with the same numbers of steps: the end of a descent depends on rounding
    "default deform of the bunny": functools.partial(deform, "bunny", iterations=20),
    "default deform of spot": functools.partial(deform, "spot", iterations=20),
    "cube style of spot": lambda: af.stylize(
        shapes.samples("spot"), "cube", af.StylizeOptions(iterations=60)
    ),
    "live drag of the bunny": functools.partial(drag, "bunny"),
    "live drag of spot": functools.partial(drag, "spot"),
    "wrap of the dog onto the lizard": wrap,
    "fit of the bunny": lambda: af.fit_sdf(*shapes.mesh("bunny"), af.FitOptions(iterations=60)),
    "neural iterations, 300 samples": functools.partial(neural, 300),
    "neural iterations, 1,000 samples": functools.partial(neural, 1000),
    "neural iterations, 4,000 samples": functools.partial(neural, 4000),
}


def serve():
    """Runs the work named by each line of the input; prints its processor time in seconds."""
    for line in sys.stdin:
        with Clock() as clock:
            WORK[line.strip()]()
        print(clock.cpu, flush=True)


class Worker:
    """A process with one of the backends."""

    def __init__(self, path):
        paths = os.pathsep.join(filter(None, [str(path), os.environ.get("PYTHONPATH")]))
        command = [sys.executable, "-c", f"from {__name__} import serve; serve()"]
        self.process = subprocess.Popen(
            command,
            cwd=shapes.ROOT,
            env={**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "2"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def seconds(self, what):
        self.process.stdin.write(what + "\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())


def run_backends():
    if not SITE.is_dir() or af.backend() != "torch":
        raise ModuleNotFoundError("needs both backends: make build, make build BACKEND=eigen")
    torch, eigen, rows = Worker(""), Worker(SITE), []
    for what in WORK:
        pairs = [(eigen.seconds(what), torch.seconds(what)) for _ in range(ROUNDS + 1)][1:]
        ratio = float(np.median([ours / theirs for ours, theirs in pairs]))
        numbers = (*np.min(pairs, axis=0).round(3).tolist(), round(ratio, 2))
        rows.append(dict(zip(("what", *COLUMNS), (what, *numbers), strict=True)))
    for worker in (torch, eigen):
        worker.process.communicate()
    return rows


# How much longer calls take while as many other processes are busy as there are processors (fair: 2).

CODE = f"""
import sys; sys.path[:0] = [{str(shapes.ROOT)!r}]
if sys.argv[2] == "torch": import torch  # which decides how OpenMP is set up
from tests.benchmarks import conditions
conditions.measure(sys.argv[1], sys.argv[3])
"""


def work(name):
    """The call that is timed: 60 iterations of a deformation, or fifteen live solves."""
    from support.geometry.cases import bar_handles, bar_samples

    import arapfields as af

    if name == "deform":
        options = af.DeformOptions(iterations=60, width=128, batch=1000)
        return lambda: af.deform(bar_samples(), bar_handles(), options)
    live = af.LiveDeformer(bar_samples(4000), bar_handles(), af.LiveOptions())

    def solve():
        for degrees in range(4, 64, 4):
            live.solve([handle.target for handle in bar_handles(degrees)])
        live.reset()

    return solve


def measure(name, rounds):
    """In a separate process: prints the seconds alone and beside busy processes, measured alternately."""
    call = work(name)
    call()
    pairs = []
    for _ in range(int(rounds)):
        alone = once(call)
        others = [
            subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1)
        ]
        try:
            pairs.append((alone, once(call)))
        finally:
            for other in others:
                other.kill()
                other.wait()
    print(json.dumps(pairs))


def slowdown(name, first, rounds=5):
    """(seconds alone, seconds beside the others, median of the ratios); `first`: module imported before."""
    run = subprocess.run(
        [sys.executable, "-c", CODE, name, first, str(rounds)], capture_output=True, text=True, check=True
    )
    pairs = json.loads(run.stdout)
    alone, beside = (statistics.median(column) for column in zip(*pairs, strict=True))
    return alone, beside, statistics.median(b / a for a, b in pairs)


def run_busy():
    rows = []
    for name in ("deform", "live"):
        for first in ("torch", "arapfields"):
            alone, beside, ratio = slowdown(name, first)
            rows.append(
                {
                    "what": f"{name}, {first} imported first",
                    "alone_s": round(alone, 3),
                    "beside_busy_s": round(beside, 3),
                    "times_as_long": round(ratio, 2),
                }
            )
    return rows


# Cost against size: seconds and peak memory above the idle process, each in a process of its own.

SAMPLES = (300, 10_000, 30_000)
RESOLUTIONS = (64, 256, 512)
TRIANGLES = (20_000, 2_000_000)

SETTING = """
import json, sys, time
from pathlib import Path
import numpy as np
import arapfields as af
sys.path[:0] = [{root!r}]
from tests.benchmarks import shapes
from support.geometry import meshes
def peak(): return int(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0]) / 1024
def torus(count):
    n = int(np.sqrt(count / 2))
    return meshes.torus(around=n, tube=n)
{prepare}
before, begin = peak(), time.perf_counter()
{work}
seconds = time.perf_counter() - begin
print(json.dumps(dict(seconds=round(seconds, 3), peak_MiB=round(peak() - before))))
"""


def measured(prepare, work):
    """The figures of one run, or its error."""
    code = SETTING.format(root=str(shapes.ROOT), prepare=prepare, work=work)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    if done.returncode:
        return {"error": done.stderr.strip().splitlines()[-1][:100]}
    return json.loads(done.stdout.splitlines()[-1])


def run_sizes():
    shapes.layers("bunny")  # fits the stand-in now if necessary
    bunny = "shapes.samples('bunny', 30000)"
    options = "af.DeformOptions(field='neural', iterations=5, {})"
    solve = f"af.deform(samples, shapes.handles('bunny', shapes.FULL), {options})"
    warm = solve.format("batch=8")
    rows = []
    for count in SAMPLES:
        cost = measured(f"samples = {bunny}\n{warm}", solve.format(f"batch={count}"))
        rows.append({"what": "5 iterations, 4x256, samples", "size": count, **cost})
    for resolution in RESOLUTIONS:
        prepare = "sdf = shapes.sdf('bunny')"
        rows.append(
            {
                "what": "extraction, points a side",
                "size": resolution,
                **measured(prepare, f"af.extract_surface(sdf, {resolution})"),
            }
        )
    for count in TRIANGLES:
        prepare = f"v, f = torus({count}); points = np.random.default_rng(0).uniform(-1, 1, (100000, 3))"
        cost = measured(prepare, "af.signed_distance(v, f, points)")
        rows.append({"what": "100,000 signed distances, triangles", "size": count, **cost})
    return rows
