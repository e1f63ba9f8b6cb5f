# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost against size: seconds and peak memory above the idle process, each in a process of its own."""

import json
import subprocess
import sys

from . import shapes

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


def run():
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
