# SPDX-License-Identifier: GPL-3.0-or-later
"""ImplicitFunction, written in Python: values, gradients, frames, errors, threads, lifetime."""

import gc
import threading
import weakref

import numpy as np
import pytest
from support.geometry import cases
from support.geometry.meshes import sphere
from support.tolerances import FUNCTION_DIFFERENCES, SPHERE_EXTRACTION

import arapfields as af

CENTER, RADIUS = np.array([3.0, -1.0, 2.0]), 2.0
FRAME = af.Frame(CENTER, 3.0)


class Ball(af.ImplicitFunction):
    """A sphere's distance, in a frame of its own."""

    def __init__(self, frame=FRAME):
        super().__init__(frame)
        self.calls = 0
        self.threads = set()

    def __call__(self, points):
        self.calls += 1
        self.threads.add(threading.get_ident())
        return np.linalg.norm(points - CENTER, axis=1) - RADIUS


class BallWithGradient(Ball):
    asked = 0

    def gradient(self, points):
        type(self).asked += 1
        arms = points - CENTER
        return arms / np.maximum(np.linalg.norm(arms, axis=1, keepdims=True), 1e-9)


kinds = pytest.mark.parametrize("kind", [Ball, BallWithGradient])


@kinds
def test_its_surface_is_extracted_in_mesh_coordinates(kind):
    ball = kind()
    V, F = af.extract_surface(ball, 64)
    assert np.abs(np.linalg.norm(V - CENTER, axis=1) - RADIUS).max() < SPHERE_EXTRACTION * FRAME.scale
    volume = np.einsum("ij,ij->i", V[F[:, 0]], np.cross(V[F[:, 1]], V[F[:, 2]])).sum() / 6
    assert volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.01)
    if kind is BallWithGradient:
        assert kind.asked > 0


@kinds
def test_it_is_sampled_with_normals_and_anew(kind):
    samples = af.sample_surface(kind(), 2000, seed=1)
    arms = samples.points - CENTER
    assert np.abs(np.linalg.norm(arms, axis=1) - RADIUS).max() < 1e-4 * FRAME.scale
    assert (samples.normals * arms).sum(1).min() > RADIUS * (1 - FUNCTION_DIFFERENCES)
    assert samples.frame == FRAME
    assert samples.report.evaluations > 0


def test_gradients_by_differences_are_near_the_exact_ones():
    points = CENTER + np.random.default_rng(0).normal(size=(200, 3))
    exact = BallWithGradient().gradient(points)
    far = np.linalg.norm(points - CENTER, axis=1) > 0.5
    assert np.abs(Ball().gradient(points) - exact)[far].max() < FUNCTION_DIFFERENCES


def test_it_serves_deformation_and_its_extraction():
    """A ball shifted by a field, whose samples are drawn anew while it is solved."""
    ball = Ball()
    samples = af.sample_surface(ball, 400)
    shift = cases.shift([0.3, 0.0, 0.0])
    rest = np.diag([4.0, 4.0, 4.0, 1.0])
    rest[:3, 3] = CENTER
    options = af.DeformOptions(width=16, layers=2, iterations=20, batch=50, fresh_samples=25)
    assert np.isfinite(af.deform(samples, [cases.moved(rest, shift)], options)(samples.points)).all()
    live = af.LiveDeformer(samples, [cases.moved(rest, shift)], af.LiveOptions(fine_centers=40))
    field = live.solve(iterations=50, tolerance=1e-8)
    V, _ = af.extract_deformed(ball, field, 32)
    assert np.abs(np.linalg.norm(V - CENTER - [0.3, 0, 0], axis=1) - RADIUS).max() < 0.05


def test_a_mesh_distance_in_python_equals_the_native_one():
    vertices, triangles = sphere(1.0, 2)

    class Mesh(af.ImplicitFunction):
        def __call__(self, points):
            return af.signed_distance(vertices, triangles, points)

    values, _, _ = af.sdf_grid(Mesh(), 8)
    nodes = np.stack(np.meshgrid(*[np.linspace(-1, 1, 9)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    assert values.reshape(-1) == pytest.approx(af.signed_distance(vertices, triangles, nodes), abs=1e-6)


def test_the_samples_keep_the_function_alive():
    ball = Ball()
    gone = weakref.ref(ball)
    samples = af.sample_surface(ball, 300)
    del ball
    gc.collect()
    options = af.DeformOptions(width=8, layers=1, iterations=5, batch=50, fresh_samples=50)
    before = gone().calls
    rest = np.diag([4.0, 4.0, 4.0, 1.0])
    rest[:3, 3] = CENTER
    af.deform(samples, [cases.moved(rest)], options)
    assert gone().calls > before
    del samples
    gc.collect()
    assert gone() is None


class Mine(Exception):
    pass


@pytest.mark.parametrize("after", [0, 3])
@pytest.mark.parametrize(
    "call",
    [
        lambda f: af.sample_surface(f, 100),
        lambda f: af.extract_surface(f, 64),
        lambda f: af.extract_deformed(f, FIELD(), 32),
        lambda f: af.sdf_grid(f, 90),
    ],
    ids=["sample", "extract", "extract_deformed", "grid"],
)
def test_what_it_raises_comes_through_unchanged(call, after):
    error = Mine("in the function")

    class Fails(Ball):
        def __call__(self, points):
            if self.calls == after:
                raise error
            return super().__call__(points)

    with pytest.raises(Mine) as caught:
        call(Fails())
    assert caught.value is error


def FIELD():
    samples = af.sample_surface(Ball(), 200)
    rest = np.diag([4.0, 4.0, 4.0, 1.0])
    rest[:3, 3] = CENTER
    return af.LiveDeformer(samples, [cases.moved(rest)], af.LiveOptions(fine_centers=20)).solve()


def test_a_jump_is_no_surface_where_the_function_says_that_it_jumps():
    """A ball cut in half by a change of sign beside its middle."""

    class Half(Ball):
        continuous = False

        def __call__(self, points):
            values = super().__call__(points)
            return np.where(points[:, 0] > CENTER[0] + 0.01, values, np.abs(values) + 0.2)

    mesh, cell = af.extract_surface(Half(), 64), 2 * FRAME.scale / 63
    assert mesh.vertices[:, 0].min() > CENTER[0] - cell
    assert np.abs(np.linalg.norm(mesh.vertices - CENTER, axis=1) - RADIUS).max() < cell  # its rim
    Half.continuous = True
    assert np.abs(np.linalg.norm(af.extract_surface(Half(), 64).vertices - CENTER, axis=1)).min() < RADIUS / 2


def test_cancel_takes_effect():
    task = af.Task()

    class Cancels(Ball):
        def __call__(self, points):
            if self.calls == 5:
                task.cancel()
            return super().__call__(points)

    ball = Cancels()
    with pytest.raises(af.Cancelled):
        af.extract_surface(ball, 256, task=task)
    assert ball.calls < 20


def test_one_thread_at_a_time_is_let_in():
    """Four callers of one object: no two are inside of it at once."""
    inside, most = [], []

    class Counts(Ball):
        def __call__(self, points):
            inside.append(1)
            most.append(len(inside))
            values = super().__call__(points)
            inside.pop()
            return values

    ball, counts = Counts(), []
    workers = [threading.Thread(target=lambda: counts.append(af.extract_surface(ball, 24))) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert len(counts) == 4 and max(most) == 1
    assert all(np.array_equal(mesh.vertices, counts[0].vertices) for mesh in counts)


def test_a_function_may_call_the_library_itself():
    inner = Ball()
    V, F = af.extract_surface(inner, 16)

    class Outer(af.ImplicitFunction):
        def __call__(self, points):
            return af.signed_distance(V, F, points)

    outer = Outer(FRAME)
    assert len(af.extract_surface(outer, 16).vertices) > 50
