# SPDX-License-Identifier: GPL-3.0-or-later
"""Implicit functions: written in Python, exact distances of meshes, and surfaces extracted from them."""

import gc
import threading
import weakref

import numpy as np
import pytest
from support import tolerances
from support.geometry import cases, meshes
from support.geometry.meshes import check_closed, sphere
from support.oracles import Network
from support.tolerances import FUNCTION_DIFFERENCES, SAME_VERTICES, SPHERE_EXTRACTION

import arapfields as af

# Implicit functions: written in Python, and the exact signed distance of a mesh.

# Implicit functions written in Python.

# ImplicitFunction, written in Python: values, gradients, frames, errors, threads, lifetime.

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
def test_errors_of_a_function_reach_the_caller(call, after):
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


def test_a_function_is_called_by_one_thread_at_a_time():
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


# ImplicitFunction, written in Python: what does not fit is named.


class PlainBall(af.ImplicitFunction):
    def __call__(self, points):
        return np.linalg.norm(points, axis=1) - 0.5


@pytest.mark.parametrize(
    "returned, word",
    [
        (lambda p: None, "NoneType"),
        (lambda p: p, "shape"),
        (lambda p: np.zeros(3), "3 values"),
        (lambda p: np.full(len(p), np.nan), "NaN"),
        (lambda p: ["x"] * len(p), "dtype"),
    ],
)
def test_results_that_do_not_fit_are_named(returned, word):
    class Odd(af.ImplicitFunction):
        def __call__(self, points):
            return returned(points)

    with pytest.raises(af.InvalidInput, match=f"^sdf: .*{word}"):
        af.extract_surface(Odd(), 32)


@pytest.mark.parametrize("bound", [1.0, np.float32(2.0), None])
def test_a_bound_on_the_gradient_is_taken(bound):
    class Bounded(PlainBall):
        gradient_bound = bound

    assert np.array_equal(
        af.extract_surface(Bounded(), 48).vertices, af.extract_surface(PlainBall(), 48).vertices
    )


@pytest.mark.parametrize("bound", [0.0, -1.0, np.nan, "steep", [1.0, 2.0]])
def test_a_bad_gradient_bound_is_named(bound):
    class Bounded(PlainBall):
        gradient_bound = bound

    with pytest.raises(af.InvalidInput, match=r"^sdf\.gradient_bound"):
        af.extract_surface(Bounded(), 48)


def test_gradients_that_do_not_fit_are_named():
    class Odd(PlainBall):
        def gradient(self, points):
            return points[:5]

    with pytest.raises(af.InvalidInput, match=r"^sdf: 5 gradients"):
        af.sample_surface(Odd(), 100)


def test_a_subclass_without_a_function_says_so():
    class Nothing(af.ImplicitFunction):
        pass

    with pytest.raises(NotImplementedError, match=r"Nothing.*__call__"):
        af.extract_surface(Nothing(), 32)
    with pytest.raises(NotImplementedError):
        af.ImplicitFunction()(np.zeros((1, 3)))


def test_a_subclass_that_forgets_its_base_is_refused():
    class Forgets(af.ImplicitFunction):
        def __init__(self):
            pass

    with pytest.raises(TypeError, match="__init__"):
        Forgets()


@pytest.mark.parametrize("wrong", [None, 5, lambda p: p])
def test_objects_that_are_no_function_are_refused(wrong):
    with pytest.raises((af.InvalidInput, TypeError), match=r"sdf|incompatible"):
        af.sample_surface(wrong)
    with pytest.raises((af.InvalidInput, TypeError)):
        af.extract_surface(wrong)


# Functions whose zeros are no surface, or a rough one: sentences that are true, and work with a bound.

MOST_VALUES = 2**20 + 2**10 * 500 + 2_000_000  # sample_surface's bound for 500 samples, and one cast of lines
SMALL_RADIUS = 0.5
QUANTUM = 0.01
ROUGH_NORMALS = np.cos(np.radians(12))  # a step wide enough for QUANTUM is a quarter of the radius


class Counted(af.ImplicitFunction):
    """A function of the distance to a ball, with the points that were asked for."""

    def __init__(self, values):
        super().__init__()
        self.values, self.asked = values, 0

    def __call__(self, points):
        self.asked += len(points)
        return self.values(np.linalg.norm(points, axis=1) - SMALL_RADIUS, points)


def noise(points):
    """Numbers in [-1, 1] that depend on each bit of the points."""
    bits = np.ascontiguousarray(points).view(np.uint64).reshape(len(points), 3)
    mixed = bits @ np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    return (mixed >> np.uint64(11)) / 2.0**52 - 1.0


def voxels(_, points):
    """±1 in the cells of a grid."""
    centers = (np.floor(points * 16) + 0.5) / 16
    return np.where(np.linalg.norm(centers, axis=1) < SMALL_RADIUS, -1.0, 1.0)


NO_SURFACES = {
    "zero inside": (lambda d, _: np.maximum(d, 0), "0 on an open set"),
    "zero outside": (lambda d, _: np.minimum(d, 0), "0 on an open set"),
    "a thick zero": (lambda d, _: np.sign(d) * np.maximum(np.abs(d) - 0.1, 0), "0 on an open set"),
    "occupancy 0 and 1": (lambda d, _: np.where(d < 0, 1.0, 0.0), "0 on an open set"),
    "occupancy ±1": (lambda d, _: np.where(d < 0, -1.0, 1.0), "jump from one sign to the other"),
    "voxels ±1": (voxels, "jump from one sign to the other"),
    "noise": (lambda _, points: noise(points), "jump|noise"),
    "noise above 0": (lambda _, points: noise(points) + 1.0, "noise"),
    "a ball in noise": (lambda d, points: d + 0.1 * noise(points), "jump|noise"),
    "too steep": (lambda d, _: 1e20 * d, "too steep"),
    "too flat": (lambda d, _: 1e-9 * d, "changes by less than"),
    "zero": (lambda d, _: 0.0 * d, "changes by less than"),
    "one": (lambda d, _: 0.0 * d + 1.0, "one sign"),
}


@pytest.mark.parametrize("name", NO_SURFACES)
def test_functions_without_a_surface_end_in_bounded_work(name):
    values, sentence = NO_SURFACES[name]
    function = Counted(values)
    with pytest.raises(af.InvalidInput, match=f"sdf: .*({sentence})"):
        af.sample_surface(function, 500)
    assert function.asked < MOST_VALUES


@pytest.mark.parametrize("name", ["zero inside", "occupancy ±1", "noise", "zero"])
def test_wrap_names_its_target(name):
    samples = af.SurfaceSamples(np.eye(3), np.eye(3))
    with pytest.raises(af.InvalidInput, match=f"target: .*({NO_SURFACES[name][1]})"):
        af.wrap(samples, Counted(NO_SURFACES[name][0]))


@pytest.mark.parametrize(
    "values",
    [
        lambda d, _: QUANTUM * np.round(d / QUANTUM),
        lambda d, points: d + 0.1 * QUANTUM * noise(points),
        lambda d, _: np.where(np.abs(d) < QUANTUM / 2, 0.0, d),
    ],
    ids=["quantised", "noisy", "thin zero"],
)
def test_normals_of_rough_distances(values):
    samples = af.sample_surface(Counted(values), 500)
    outwards = samples.points / np.linalg.norm(samples.points, axis=1, keepdims=True)
    assert np.abs(np.linalg.norm(samples.points, axis=1) - SMALL_RADIUS).max() < QUANTUM
    assert np.einsum("ij,ij->i", samples.normals, outwards).min() > ROUGH_NORMALS


def test_an_occupancy_has_a_mesh():
    """Of ±1 marching cubes make the cells' middles; the signs are both there."""
    V, F = af.extract_surface(Counted(NO_SURFACES["occupancy ±1"][0]), 32)
    assert len(F) and np.abs(np.linalg.norm(V, axis=1) - SMALL_RADIUS).max() < 2 / 31


# MeshSdf, the exact signed distance as an implicit function: extracted, sampled, deformed without a fit.


def joined(*parts):
    """One soup of several meshes."""
    offsets = np.cumsum([0, *(len(V) for V, _ in parts)])
    F = np.concatenate([F + offset for (_, F), offset in zip(parts, offsets, strict=False)])
    return np.concatenate([V for V, _ in parts]), F


def moved(mesh, offset):
    return mesh[0] + np.asarray(offset, float), mesh[1]


def bowl():
    """The lower half of a sphere, open at the top."""
    V, F = meshes.sphere(1.0, 4)
    return V, F[V[F, 2].max(1) < 0.05]


SHAPES = {
    "torus": lambda: meshes.torus(),
    "plate": lambda: meshes.box((1.0, 0.7, 0.025)),
    "overlapping": lambda: joined(
        meshes.sphere(1.0, 3), moved(meshes.sphere(0.7, 3), [0.8, 0.1, 0]), meshes.box((1.5, 0.2, 0.2))
    ),
}


def dense_crossings(V, F, n):
    """Where the whole grid's edges cross the surface, in mesh coordinates."""
    frame = af.MeshSdf(V, F).frame
    t = np.linspace(-1, 1, n)
    grid = np.stack(np.meshgrid(t, t, t, indexing="ij"), -1).reshape(-1, 3)
    values = af.signed_distance(V, F, frame.to_mesh(grid.astype(np.float32)))
    grid, values = grid.reshape(n, n, n, 3), (values / frame.scale).astype(np.float32).reshape(n, n, n)
    results = []
    for axis in range(3):
        low, high = (np.take(values, range(a, n - 1 + a), axis).astype(float) for a in (0, 1))
        x, y = (np.take(grid, range(a, n - 1 + a), axis) for a in (0, 1))
        crossed = (low < 0) != (high < 0)
        share = (low[crossed] / (low[crossed] - high[crossed]))[:, None]
        results.append(x[crossed] + share * (y[crossed] - x[crossed]))
    return frame.to_mesh(np.concatenate(results))


@pytest.mark.parametrize("n", [33, 64, 96])
@pytest.mark.parametrize("shape", SHAPES)
def test_extraction_has_every_vertex_of_the_whole_grid(shape, n):
    spatial = pytest.importorskip("scipy.spatial")
    V, F = SHAPES[shape]()
    expected = dense_crossings(V, F, n)
    extraction = af.extract_surface(af.MeshSdf(V, F), n)
    (vertices, triangles), report = extraction, extraction.report
    assert len(vertices) >= len(expected)  # and those within cells
    assert spatial.cKDTree(vertices).query(expected)[0].max() < tolerances.SAME_VERTICES
    check_closed(vertices, triangles)
    assert report.evaluations < 0.4 * n**3 and not report.open


def test_values_and_gradients():
    V, F = SHAPES["overlapping"]()
    sdf = af.MeshSdf(V * 50, F)  # millimetres
    points = np.random.default_rng(0).uniform(-120, 120, (500, 3))
    assert np.array_equal(sdf(points), af.signed_distance(V * 50, F, points))
    steps = 1e-4 * np.eye(3)
    differences = np.stack([(sdf(points + s) - sdf(points - s)) / 2e-4 for s in steps], -1)
    smooth = np.abs(np.linalg.norm(differences, axis=1) - 1.0) < 1e-6  # not beside a crease
    assert smooth.mean() > 0.99
    gradients = sdf.gradient(points)
    assert np.abs(gradients - differences)[smooth].max() < 1e-6
    assert np.allclose(np.linalg.norm(gradients, axis=1), 1.0)
    corners = V[F] * 50
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    inner = corners.mean(1)[:100]
    assert np.einsum("ij,ij->i", sdf.gradient(inner), normals[:100]).min() > 0.999
    assert sdf.closed and np.isclose(sdf.frame.scale, 50 * af.MeshSdf(V, F).frame.scale)


def test_samples_are_uniform_on_the_outer_surface():
    half = np.array([0.9, 0.6, 0.3])
    V, F = joined(meshes.box(half), moved(meshes.sphere(0.2, 2), [0.1, 0, 0]))  # the ball is hidden
    sdf = af.MeshSdf(V, F)
    samples = af.sample_surface(sdf, 20000, seed=2)
    assert np.abs(sdf(samples.points)).max() <= tolerances.ON_SURFACE
    axis = np.argmin(np.abs(np.abs(samples.points) - half), axis=1)
    rows = np.arange(len(axis))
    side = samples.points[rows, axis] > 0
    assert (np.einsum("ij,ij->i", samples.normals, np.eye(3)[axis]) * np.where(side, 1, -1)).min() > 0.999
    others = np.array([[1, 2], [2, 0], [0, 1]])[axis]
    uv = np.take_along_axis(samples.points / half, others, 1)
    cells = np.clip(((uv + 1) * 2).astype(int), 0, 3)
    bins = np.bincount(((axis * 2 + side) * 4 + cells[:, 0]) * 4 + cells[:, 1], minlength=96)
    areas = np.repeat([half[1] * half[2], half[2] * half[0], half[0] * half[1]], 32)
    expected = len(axis) * areas / areas.sum()
    chi = ((bins - expected) ** 2 / expected).sum()
    assert (chi - 95) / np.sqrt(2 * 95) < 3.1  # the one-sided 0.1 % point; the seed is fixed


def test_deformed_like_the_triangles_themselves():
    V, F = meshes.subdivide(*meshes.subdivide(*meshes.box((0.8, 0.15, 0.15))))
    sdf = af.MeshSdf(V, F)
    options = af.DeformOptions(field="radial", iterations=60)
    ours, theirs = (
        af.deform(samples, cases.bar_handles(), options)
        for samples in (af.sample_surface(sdf, 4000), af.sample_mesh(V, F, 4000))
    )
    motion = np.linalg.norm(theirs(V) - V, axis=1).max()
    assert np.linalg.norm(ours(V) - theirs(V), axis=1).max() < 0.02 * motion
    extraction = af.extract_deformed(sdf, ours, 48)
    (after, triangles), report = extraction, extraction.report
    check_closed(after, triangles)
    assert np.abs(af.signed_distance(ours(V), F, after)).max() < 1.5 * report.spacing
    styled = af.stylize(
        af.sample_surface(sdf, 2000), "cube", af.StylizeOptions(iterations=5, width=16, layers=2)
    )
    assert np.isfinite(styled(V)).all()


def test_holes_stay_open_and_cracks_close():
    V, F = bowl()
    sdf = af.MeshSdf(V, F)
    assert not sdf.closed
    (after, _), report = (extraction := af.extract_surface(sdf, 64)), extraction.report
    step = 2.0 * sdf.frame.scale / 63
    assert np.abs(sdf(after)).max() <= 0.5 * step * 1.001 and report.open
    samples = af.sample_surface(sdf, 3000)
    assert np.abs(sdf(samples.points)).max() <= tolerances.ON_SURFACE * sdf.frame.scale
    whole, G = meshes.sphere(1.0, 4)  # a triangle is much smaller than a cell of 16 a side
    af_sdf = af.MeshSdf(whole, G[1:])
    check_closed(*af.extract_surface(af_sdf, 16))
    assert not af_sdf.closed


def test_an_open_mesh_is_deformed_open():
    V, F = bowl()
    sdf = af.MeshSdf(V, F)
    rest = cases.box([-2, -2, -2], [2, 2, -0.8])
    rim = cases.box([0.7, -2, -0.3], [2, 2, 0.3])
    handles = [cases.moved(rest), cases.moved(rim, cases.shift([0.2, 0, 0.1]))]
    field = af.deform(af.sample_surface(sdf, 3000), handles, af.DeformOptions(field="radial", iterations=40))
    (after, _), report = (extraction := af.extract_deformed(sdf, field, 48)), extraction.report
    distance = np.abs(af.signed_distance(field(V), F, after))
    assert report.open and distance.max() < 1.5 * report.spacing


def test_bad_input_is_named():
    V, F = meshes.sphere(1.0, 1)
    with pytest.raises(af.InvalidInput, match="triangles"):
        af.MeshSdf(V, F + 1000)
    with pytest.raises(af.InvalidInput, match="points"):
        af.MeshSdf(V, F)([[np.nan, 0, 0]])
    with pytest.raises(af.InvalidInput, match=r"save.*fit_sdf"):
        af.MeshSdf(V, F).save("somewhere")
    task = af.Task()
    task.cancel()
    with pytest.raises(af.Cancelled):
        af.extract_surface(af.MeshSdf(V, F), 64, task=task)


# extract_surface on the published networks against scikit-image on the dense grid.

NAMES = ["bunny", "cube", "frog", "hand", "spot", "whale"]
DENSE_SHARE = 0.12  # most evaluations at 128 points a side, of the dense grid's


def published(data_dir, name):
    return af.NeuralSdf.from_layers(*Network.published(data_dir / "neural_sdf" / f"{name}.pt").layers)


def dense_surface(sdf, n):
    measure = pytest.importorskip("skimage.measure")
    t = np.linspace(-1, 1, n)
    slabs = [sdf(np.stack(np.meshgrid(x, t, t, indexing="ij"), -1).reshape(-1, 3)) for x in t]
    values = np.concatenate(slabs).reshape(n, n, n).astype(np.float32)
    return measure.marching_cubes(values, 0.0)[0] * (2 / (n - 1)) - 1


def check_same_vertices(ours, theirs):
    spatial = pytest.importorskip("scipy.spatial")
    assert len(ours) == len(theirs)
    assert spatial.cKDTree(theirs).query(ours)[0].max() < SAME_VERTICES
    assert spatial.cKDTree(ours).query(theirs)[0].max() < SAME_VERTICES


@pytest.mark.parametrize("name", ["bunny"])
def test_equals_scikit_image_on_a_coarse_grid(data_dir, name):
    sdf = published(data_dir, name)
    V, F = af.extract_surface(sdf, 40)
    check_same_vertices(V, dense_surface(sdf, 40))
    check_closed(V, F)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_equals_scikit_image_from_few_evaluations(data_dir, name):
    sdf = published(data_dir, name)
    mesh = af.extract_surface(sdf, 128)
    (V, F), report = mesh, mesh.report
    check_same_vertices(V, dense_surface(sdf, 128))
    check_closed(V, F)
    assert report.dense_evaluations == 128**3
    assert report.evaluations <= DENSE_SHARE * 128**3
    assert not report.open


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "n"),
    [("spot", 71), ("shiba", 85), ("shiba", 100), ("shiba", 107), ("shiba", 114), ("shiba", 121)],
)
def test_grid_points_beside_thin_sheets_are_not_passed_over(data_dir, name, n):
    sdf = published(data_dir, name)
    check_same_vertices(af.extract_surface(sdf, n)[0], dense_surface(sdf, n))


def test_a_thin_animal_is_named_and_held_together(data_dir):
    """The published gecko, whose toes and tail are thinner than two cells of 128 a side."""
    sdf = published(data_dir, "geko")
    plain = af.extract_surface(sdf, 128)
    check_closed(*plain)
    assert plain.report.pieces == 11 and plain.report.thin_cells > 0
    (note,) = plain.report.notes
    assert "11 pieces" in note and str(plain.report.holding_resolution) in note
    refined = af.extract_surface(sdf, 128, refine_thin=True)
    check_closed(*refined)
    assert refined.report.pieces == 1 and refined.report.notes == ()
    finer = af.extract_surface(sdf, plain.report.holding_resolution).report
    assert finer.pieces == 1
    assert refined.report.evaluations < 0.5 * finer.evaluations


def test_bad_arguments_and_cancel(data_dir):
    sdf = published(data_dir, "bunny")
    for resolution in (0, 7, 513):
        with pytest.raises(af.InvalidInput, match="resolution"):
            af.extract_surface(sdf, resolution)
    with pytest.raises(af.InvalidInput, match="threads"):
        af.extract_surface(sdf, 32, threads=-1)
    task = af.Task()
    task.cancel()
    with pytest.raises(af.Cancelled):
        af.extract_surface(sdf, 32, task=task)


def test_no_surface():
    zero = [np.zeros((4, 24)), np.zeros((1, 4))]
    with pytest.raises(af.InvalidInput, match="one sign"):
        af.extract_surface(af.NeuralSdf.from_layers(zero, [np.zeros(4), np.ones(1)]), 32)
