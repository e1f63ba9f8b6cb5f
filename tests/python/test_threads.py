# SPDX-License-Identifier: GPL-3.0-or-later
"""Threads of the library, of callers and of other processes."""

import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from support.geometry.cases import bar_handles, bar_samples
from support.geometry.meshes import torus
from support.tolerances import BUSY_SLOWDOWN

import arapfields as af
from arapfields._files import lock, unlock

# The library's own threads: a number for each call, the same results for all; libtorch's are left alone.

COUNTS = (1, 2, 3, 5)
TESTS = str(Path(__file__).parents[1])
needs_proc = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="no /proc to see threads in")


def deformed(threads, **options):
    settings = dict(iterations=6, width=64, layers=3, batch=300, threads=threads) | options
    return af.deform(bar_samples(), bar_handles(), af.DeformOptions(**settings))


def network():
    rng = np.random.default_rng(4)
    sizes = [(32, 24), (32, 32), (1, 32)]
    return af.NeuralSdf.from_layers(
        [rng.normal(size=size) / np.sqrt(size[1]) for size in sizes],
        [0.1 * rng.normal(size=n) for n, _ in sizes],
    )


def fit(threads):
    settings = dict(iterations=12, width=64, layers=3, batch=600, near_points=9000, uniform_points=3000)
    return af.fit_sdf(*torus(), options=af.FitOptions(threads=threads, **settings))


def stylized(threads):
    options = dict(iterations=5, width=64, layers=3, batch=300, threads=threads)
    return af.stylize(bar_samples(), "cube", af.StylizeOptions(**options))


def live(threads):
    settings = dict(samples=900, coarse_centers=30, fine_centers=420, threads=threads)
    solver = af.LiveDeformer(bar_samples(), bar_handles(20), af.LiveOptions(**settings))
    return solver.solve([handle.target for handle in bar_handles(30)])


def sampled(threads):
    samples = af.sample_surface(network(), count=2000, seed=1, threads=threads)
    return np.c_[samples.points, samples.normals]


def extracted(threads):
    v, f = af.extract_surface(network(), 48, threads=threads)
    return np.r_[v.ravel(), f.ravel()]


def inverted(threads):
    options = af.InverseOptions(iterations=4, width=48, layers=2, batch=200, threads=threads)
    return af.train_inverse(deformed(1), bar_samples(), options)


def distances(threads):
    return af.signed_distance(*torus(), np.random.default_rng(0).uniform(-2, 2, (3000, 3)), threads=threads)


def numbers(result):
    points = np.random.default_rng(5).uniform(-0.8, 0.8, (700, 3))
    if callable(result):
        derivative = result.jacobian if hasattr(result, "jacobian") else result.gradient
        return np.concatenate([np.ravel(result(points)), np.ravel(derivative(points))])
    return result


CALLS = {
    "deform": deformed,
    "deform, no derivatives' batch of one block": lambda threads: deformed(threads, batch=40),
    "deform, radial": lambda threads: deformed(threads, field="radial", iterations=10),
    "deform, exact handles": lambda threads: deformed(threads, exact_handles=True),
    "deform, bfloat16": lambda threads: deformed(threads, precision="bfloat16"),
    "stylize": stylized,
    "fit": fit,
    "live": live,
    "samples": sampled,
    "extraction": extracted,
    "trained inverse": inverted,
    "distances": distances,
}


@pytest.mark.parametrize("name", CALLS)
def test_results_are_the_same_for_every_number_of_threads(name):
    results = [numbers(CALLS[name](threads)) for threads in COUNTS]
    assert np.isfinite(results[0]).all()
    assert all(np.array_equal(results[0], result) for result in results[1:])


def run_script(code, stack=None, **environment):
    """What a process prints; `stack` is the size of its threads' stacks, in bytes."""
    code = f"import sys; sys.path[:0] = [{TESTS!r}, {TESTS + '/python'!r}]\n{code}"

    def small_stacks():
        import resource

        resource.setrlimit(resource.RLIMIT_STACK, (stack, stack))

    # Of NumPy's BLAS nothing is wanted here: its threads would be taken for ours.
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", **environment}
    run = subprocess.run(
        [sys.executable, "-c", code],
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        preexec_fn=small_stacks if stack else None,
    )
    assert run.returncode == 0, f"{run.returncode}: {run.stdout}{run.stderr}"
    return run.stdout.strip()


@needs_proc
def test_no_thread_of_another_s_is_started():
    """Threads of libtorch's OpenMP have their process's name, ours one of their own."""
    names = run_script(
        "from pathlib import Path\nimport test_threads as t\n"
        "for name, call in t.CALLS.items(): t.numbers(call(3))\n"
        "print(sorted(p.read_text().strip() for p in Path('/proc/self/task').glob('*/comm')))"
    )
    names = eval(names)
    assert names.count("arapfields") == 2 and len(names) == 3


def test_concurrent_calls_keep_their_thread_counts():
    torch = pytest.importorskip("torch")
    before = torch.get_num_threads()
    torch.set_num_threads(3)
    try:
        seen = []
        calls = [lambda n=n: [seen.append((n, numbers(deformed(n)))) for _ in range(2)] for n in (1, 2, 5)]
        workers = [threading.Thread(target=call) for call in [*calls, lambda: live(4), lambda: fit(2)]]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
        expected = numbers(deformed(1))
        assert len(seen) == 6 and all(np.array_equal(expected, result) for _, result in seen)
        assert torch.get_num_threads() == 3 and af.thread_count() == 3
        elsewhere = []
        fresh = threading.Thread(
            target=lambda: elsewhere.append((torch.get_num_threads(), af.thread_count()))
        )
        fresh.start()
        fresh.join()
        assert elsewhere == [(3, 3)]
    finally:
        torch.set_num_threads(before)


def test_after_a_call_torch_still_uses_its_threads():
    used = run_script(
        "import torch, test_threads as t; from pathlib import Path\n"
        "torch.set_num_threads(3); t.deformed(2)\n"
        "count = lambda: len(list(Path('/proc/self/task').iterdir()))\n"
        "before = count(); torch.mm(torch.ones(999, 999), torch.ones(999, 999)); print(count() - before)"
    )
    assert used == "2"


FORK = """
import os, time, numpy as np, test_threads as t
{first}
expected = t.numbers(t.deformed(3))
child = os.fork()
if child == 0:
    os._exit(0 if all(np.array_equal(expected, t.numbers(t.deformed(n))) for n in (3, 2)) else 5)
end = time.monotonic() + 120
while time.monotonic() < end:
    found, status = os.waitpid(child, os.WNOHANG)
    if found: break
    time.sleep(0.05)
else:
    os.kill(child, 9)
    status = "hangs"
assert np.array_equal(expected, t.numbers(t.deformed(3)))
print(status)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.parametrize(
    "first",
    ["", "import torch; torch.set_num_threads(3); torch.mm(torch.ones(999, 999), torch.ones(999, 999))"],
)
def test_a_forked_child_works(first):
    assert run_script(FORK.format(first=first)) == "0"


def test_too_many_threads_are_refused():
    assert np.array_equal(numbers(deformed(1024)), numbers(deformed(1)))
    with pytest.raises(af.InvalidInput, match="threads"):
        deformed(1025)


@needs_proc
def test_threads_that_the_system_refuses_are_done_without():
    """Stacks of a gibibyte, of which no further one fits into the address space."""
    assert (
        run_script(
            "import resource, numpy as np, threading, test_threads as t; from pathlib import Path\n"
            "expected = t.numbers(t.deformed(1)); t.deformed(2)\n"
            "used = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()\n"
            "resource.setrlimit(resource.RLIMIT_AS, (used + (800 << 20),) * 2)\n"
            "print(np.array_equal(expected, t.numbers(t.deformed(1000))))",
            stack=1 << 30,
        )
        == "True"
    )


def test_a_cancelled_call_leaves_working_threads():
    task = af.Task()
    canceller = threading.Timer(0.3, task.cancel)
    points = np.random.default_rng(0).uniform(-2, 2, (3_000_000, 3))
    canceller.start()
    with pytest.raises(af.Cancelled):
        af.signed_distance(*torus(around=400, tube=400), points, threads=3, task=task)
    canceller.join()
    assert np.isfinite(distances(3)).all()


def test_no_variable_of_the_environment_is_touched():
    assert (
        run_script("import os; before = dict(os.environ); import arapfields; print(before == os.environ)")
        == "True"
    )


# Beside as many busy processes as there are processors, a call takes little more than twice as long.


@pytest.mark.slow
@pytest.mark.parametrize("name", ["deform", "live"])
@pytest.mark.parametrize("first", ["torch", "arapfields"])
def test_other_processes_cost_only_their_share(name, first):
    from benchmarks import conditions

    *_, ratio = conditions.slowdown(name, first)
    assert ratio <= BUSY_SLOWDOWN


# The end of a process whose daemon threads are at work in the library: the exit code is the script's own.

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


def test_daemon_threads_in_numpys_copies_leave_the_exit_code():
    """NumPy lets Python's lock go while it copies: of 150 such processes, 12 to 14 damaged memory."""
    command = [sys.executable, "-c", BEGIN + LOOPS["implicit function"] + END]
    with ThreadPoolExecutor(5) as at_once:
        ended = list(
            at_once.map(lambda _: subprocess.run(command, capture_output=True).returncode, range(30))
        )
    assert ended == [3] * 30


# Locks on bytes of a file: threads of one process, and another process.

THREADS, ROUNDS = 8, 100
LOCK_ALL = """
import sys
from arapfields._files import lock
file = open(sys.argv[1], "ab")
for byte in range(int(sys.argv[2])):
    lock(file, byte, wait=False)
"""


def test_threads_lock_and_unlock_bytes_of_one_file(tmp_path):
    with (tmp_path / "lock").open("ab") as file, ThreadPoolExecutor(THREADS) as pool:

        def work(byte):
            for _ in range(ROUNDS):
                lock(file, byte, wait=False)
                unlock(file, byte)

        list(pool.map(work, range(THREADS)))
        command = [sys.executable, "-c", LOCK_ALL, str(file.name), str(THREADS)]
        assert subprocess.run(command, timeout=60).returncode == 0
