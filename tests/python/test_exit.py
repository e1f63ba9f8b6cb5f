# SPDX-License-Identifier: GPL-3.0-or-later
"""The end of a process whose daemon threads are at work in the library: the exit code is the script's own."""

import subprocess
import sys

import pytest

BEGIN = """
import sys, tempfile, threading, time
import numpy as np
import arapfields as af
points = np.random.default_rng(0).normal(size=(1000, 3))
points /= np.linalg.norm(points, axis=1, keepdims=True)
samples = af.SurfaceSamples(points, points)
handles = [af.PointHandle([0, 0, -1], [0, 0, -1]), af.PointHandle([0, 0, 1], [0.5, 0, 1])]
network = af.DeformOptions(field="neural", iterations=1000, width=8, layers=1)
began = threading.Event()

def spend_time(*_):
    began.set()
    return sum(range(1000))
"""
LOOPS = {
    "live solves": """
live = af.LiveDeformer(samples, handles, af.LiveOptions(
    samples=60, coarse_centers=4, fine_centers=12, iterations=2, interior=False, threads=1))
def turn():
    live.solve([[0, 0, -1.0], [0.1, 0, 1.0]])
    began.set()
""",
    "callback": """
def turn():
    af.deform(samples, handles, network, callback=spend_time)
""",
    "callback that stops": """
def stop(_):
    spend_time()
    raise StopIteration
def turn():
    af.deform(samples, handles, network, callback=stop)
""",
    "energy": """
def energy(jets):
    spend_time()
    return (float((jets.values**2).mean()),)
def turn():
    af.deform(samples, handles, network, energies=[energy])
""",
    "implicit function": """
class Ball(af.ImplicitFunction):
    def __call__(self, points):
        spend_time()
        return np.linalg.norm(points, axis=1) - 0.5
    @property
    def gradient_bound(self):
        spend_time()
        return 1.0
def turn():
    af.extract_surface(Ball(), 16)
""",
    "saved fields": """
field = af.deform(samples, handles, af.DeformOptions(iterations=1))
folder = tempfile.mkdtemp()
def turn():
    field.save(f"{folder}/{threading.get_ident()}")
    field.report
    began.set()
""",
}
END = """
def loop():
    while True:
        turn()
for _ in range(2):
    threading.Thread(target=loop, daemon=True).start()
began.wait(30)
time.sleep(0.05)
sys.exit(3)
"""


@pytest.mark.parametrize("loop", LOOPS)
def test_daemon_threads_at_work_leave_the_exit_code(loop):
    for _ in range(2):
        command = [sys.executable, "-c", BEGIN + LOOPS[loop] + END]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
        assert ended.returncode == 3, ended.stderr[-2000:]
