# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields as Python sees them: derivatives, arrays, files, solves over radial ones, and inverses."""

import numpy as np
import pytest
from support import tolerances
from support.geometry import cases, meshes
from support.geometry.meshes import LEFT, RIGHT, bar_samples, turned
from support.oracles import Network
from support.tasks import cancelled_when

import arapfields as af

# Fields as Python sees them, and solves over radial ones: derivatives, inverses, arrays, files.

# Fields as Python sees them: derivatives against differences, exact handles, inverse, files.


@pytest.fixture(scope="module")
def samples():
    return cases.bar_samples()


QUICK = dict(width=32, layers=3, iterations=60, batch=100, handle_batch=50)


@pytest.fixture(scope="module")
def bent(samples):
    return af.deform(samples, cases.bar_handles(), af.DeformOptions(**QUICK))


@pytest.fixture(scope="module")
def exact(samples):
    return af.deform(samples, cases.bar_handles(), af.DeformOptions(exact_handles=True, **QUICK))


@pytest.fixture(scope="module")
def refined(samples):
    """A network on a radial field, between exact handles."""
    options = af.DeformOptions(start="radial", centers=60, exact_handles=True, **QUICK)
    return af.deform(samples, cases.bar_handles(), options)


@pytest.fixture(scope="module")
def wrapped(samples):
    """A flow: maps one after the other."""
    onto = af.MeshSdf(
        samples.points * [1.2, 1.1, 0.9], np.arange(len(samples.points) - 2)[:, None] + [0, 1, 2]
    )
    return af.wrap(samples, onto, options=af.WrapOptions(centers=40, stages=3, iterations=2))


def differences(function, points, step=2e-3):
    """Central differences of fourth order, the new axis last."""
    columns = []
    for k in range(3):
        h = step * np.eye(3)[k]
        near = function(points + h) - function(points - h)
        far = function(points + 2 * h) - function(points - 2 * h)
        columns.append((8 * near - far) / (12 * step))
    return np.stack(columns, -1)


@pytest.mark.parametrize("kind", ["bent", "exact", "refined", "wrapped"])
def test_derivatives_against_differences(kind, samples, request):
    field = request.getfixturevalue(kind)
    points = samples.points[:40] * 0.97
    jacobian, hessian = field.jacobian(points), field.hessian(points)
    assert np.abs(jacobian - differences(field, points)).max() < tolerances.FLOAT_FIELD_DIFFERENCES
    error = np.abs(hessian - differences(field.jacobian, points)).max()
    assert error < tolerances.FLOAT_FIELD_DIFFERENCES * max(1.0, np.abs(hessian).max())
    assert np.allclose(hessian, hessian.transpose(0, 1, 3, 2), atol=1e-6)


def test_derivatives_in_mesh_coordinates():
    """The same problem ten times as large and shifted: same J, a tenth of H."""
    small = cases.bar_samples(400)
    frame = af.Frame([5.0, -3.0, 2.0], 10.0)
    large = af.SurfaceSamples(frame.to_mesh(small.points), small.normals, frame=frame)
    place = cases.shift(frame.center) @ np.diag([10.0, 10.0, 10.0, 1.0])
    handles = [af.Cuboid(place @ h.rest, place @ h.target) for h in cases.bar_handles()]
    options = af.DeformOptions(**QUICK)
    a, b = af.deform(small, cases.bar_handles(), options), af.deform(large, handles, options)
    x = small.points[:20]
    y = frame.to_mesh(x)
    assert np.allclose(frame.to_cube(b(y)), a(x), atol=1e-6)
    assert np.allclose(b.jacobian(y), a.jacobian(x), atol=1e-5)
    assert np.allclose(b.hessian(y) * 10, a.hessian(x), atol=1e-4)
    assert np.allclose(b.inverse(b(y)), y, atol=1e-4)
    assert b.report.handle_error_max == pytest.approx(10 * a.report.handle_error_max, rel=1e-4)


def test_inverse_returns_to_the_start(bent, samples):
    points = samples.points * 0.99
    back = bent.inverse(bent(points))
    error = np.linalg.norm(back - points, axis=1)
    assert not np.isnan(error).any()
    assert np.quantile(error, 0.95) < tolerances.NEWTON_INVERSE


def test_inverse_reports_points_without_a_preimage(bent):
    back = bent.inverse([[np.inf, 0.0, 0.0], [np.nan, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert np.isnan(back[:2]).all()
    assert np.allclose(bent(back[2:]), 0.0, atol=2e-6)
    unreachable = bent.inverse(np.full((1, 3), 0.3), tolerance=1e-30)
    assert np.isnan(unreachable).all()


@pytest.mark.parametrize("kind", ["bent", "exact", "refined"])
def test_files_round_trip(kind, request, tmp_path, samples):
    field = request.getfixturevalue(kind)
    field.save(tmp_path / "field.safetensors")
    again = af.DeformationField.load(tmp_path / "field.safetensors")
    points = samples.points[:100]
    assert np.array_equal(again(points), field(points))
    assert np.array_equal(again.hessian(points), field.hessian(points))
    assert np.array_equal(again.inverse(points), field.inverse(points), equal_nan=True)
    assert again.report == field.report and again.frame == field.frame


def test_bad_points_are_named(bent):
    with pytest.raises(af.InvalidInput, match="points"):
        bent([[0.0, 1.0]])
    with pytest.raises(af.InvalidInput, match=r"points.*finite"):
        bent([[0.0, 1.0, np.nan]])
    assert bent(np.zeros((0, 3))).shape == (0, 3)
    assert bent.hessian(np.zeros((0, 3))).shape == (0, 3, 3, 3)


def test_distortion_at_points(bent, samples):
    points = samples.points[:300]
    measured = af.distortion(bent, points)
    stretches = np.linalg.svd(bent.jacobian(points), compute_uv=False)
    determinants = np.linalg.det(bent.jacobian(points))
    assert measured.min_determinant == pytest.approx(determinants.min(), rel=1e-6)
    assert measured.flipped_share == (determinants <= 0).mean()
    assert measured.max_stretch == pytest.approx(stretches.max(), rel=1e-6)
    assert measured.min_stretch == pytest.approx(stretches.min(), rel=1e-6)
    with pytest.raises(af.InvalidInput, match=r"samples|points"):
        af.distortion(bent, np.zeros((0, 3)))


# deform and stylize over a radial field, and networks that start from one.

# Of the soft handles' energy, which stay up to 2 % of the bar's width behind.
EXACT_PRICE = 1.5
# Of the energy at rest, what is left where many centers take over from a few.
START_SHARE = 0.01
# Of the loss at the end, what is left after ten steps: the preconditioner knows the whole surface.
NEAR_THE_END = 4.0


@pytest.fixture(scope="module")
def bar():
    return bar_samples()


@pytest.fixture(scope="module")
def handles():
    return [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, turned(50) @ RIGHT)]


@pytest.fixture(scope="module")
def radial(bar, handles):
    return af.deform(bar, handles, af.DeformOptions(field="radial"))


def test_deform_radial_reaches_less_energy_than_a_short_training(bar, handles, radial):
    neural = af.deform(bar, handles, af.DeformOptions(width=64, iterations=60, learning_rate=5e-3))
    assert isinstance(radial, af.RadialField)
    assert radial.report.energy < 0.9 * neural.report.energy
    assert radial.report.flipped_share == 0 and radial.report.iterations < 300
    values = [value for _, value in radial.report.loss]
    assert (np.diff(values) <= 1e-12).all()


def test_a_network_refines_the_radial_result(bar, handles, radial, tmp_path):
    options = {"width": 64, "iterations": 40, "learning_rate": 3e-3}
    refined = af.deform(bar, handles, af.DeformOptions(start="radial", **options))
    cold = af.deform(bar, handles, af.DeformOptions(**options))
    assert refined.report.handle_error_mean < 0.3 * cold.report.handle_error_mean
    assert refined.report.energy < 1.1 * radial.report.energy
    refined.save(tmp_path / "refined.safetensors")
    again = af.DeformationField.load(tmp_path / "refined.safetensors")
    assert np.array_equal(again(bar.points[:50]), refined(bar.points[:50]))


def test_radial_is_the_default_without_network_options(handles):
    samples = bar_samples(1500)
    assert isinstance(af.deform(samples, handles), af.RadialField)
    few = af.DeformOptions(iterations=3, bending=2.0, barrier=1.0)
    assert isinstance(af.deform(samples, handles, few), af.RadialField)
    for options in ({"width": 16}, {"optimizer": "adam"}, {"start": "radial"}, {"field": "neural"}):
        options = af.DeformOptions(iterations=3, centers=100, **options)
        assert not isinstance(af.deform(samples, handles, options), af.RadialField)
    assert isinstance(af.stylize(samples, "cube", af.StylizeOptions(iterations=3)), af.RadialField)
    network = af.StylizeOptions(iterations=3, width=16)
    assert not isinstance(af.stylize(samples, "cube", network), af.RadialField)


def test_many_centers_start_from_a_few(bar, handles):
    """The final result is better than that of a few centers, and already begins near it."""
    few = af.deform(bar, handles, af.DeformOptions(field="radial", centers=300)).report
    many = af.deform(bar, handles, af.DeformOptions(field="radial", centers=900)).report
    total = [report.energy + 100 * report.handle_error_mean**2 for report in (many, few)]
    assert total[0] < total[1]
    near = 1.02  # their energies are those of different samples
    assert many["loss"][0][1] < near * few["loss"][0][1] and many["flipped_share"] == 0


def test_many_centers_start_near_a_few_on_thin_parts_too():
    """A ball with a thin rod: where few samples carry many centers, what the few found still is a start."""
    v, f = meshes.sphere()
    rod, g = meshes.box((2.0, 0.1, 0.1))
    samples = af.sample_mesh(
        np.concatenate([v, rod + np.array([2.9, 0, 0])]), np.concatenate([f, g + len(v)]), 5000
    )
    held, end = cases.box([-2, -2, -2], [-0.3, 2, 2]), cases.box([4, -2, -2], [6, 2, 2])
    turn = cases.turn([0, 1, 0], 60, (1.0, 0.0, 0.0))
    few = af.deform(samples, [cases.moved(held), cases.moved(end, turn)], af.DeformOptions(centers=300))
    losses = []
    many = af.deform(
        samples, [cases.moved(held), cases.moved(end, turn)], callback=lambda step: losses.append(step.loss)
    )
    assert losses[0] < START_SHARE * 100 * end_distance(samples, end, turn)
    assert many.report.energy < few.report.energy and many.report.flipped_share == 0


def test_loose_parts_that_nearly_touch_are_solved_in_few_steps():
    """A lamp: a base, a post in a ball, rings about it and plates beside it, which the field tells apart."""
    shapes = [
        (meshes.box((0.5, 0.5, 0.1)), (0, 0, -1)),
        (meshes.box((0.06, 0.06, 0.62)), (0, 0, -0.3)),
        (meshes.sphere(0.35), (0, 0, 0.5)),
        (meshes.torus(0.36, 0.02), (0, 0, 0.4)),
        (meshes.torus(0.36, 0.02), (0, 0, 0.47)),
        (meshes.box((0.02, 0.1, 0.2)), (0.4, 0, 0.3)),
        (meshes.box((0.008, 0.12, 0.2)), (0.43, 0, 0.25)),
    ]
    firsts = np.cumsum([0] + [len(shape[0]) for shape, _ in shapes])
    v = np.concatenate([shape[0] + place for shape, place in shapes])
    f = np.concatenate([shape[1] + first for (shape, _), first in zip(shapes, firsts, strict=False)])
    base, ball = cases.box([-1, -1, -1.2], [1, 1, -0.8]), cases.box([-1, -1, 0.6], [1, 1, 0.9])
    turn = cases.shift([0.3, 0, 0]) @ cases.turn([0, 1, 0], 20, (0, 0, 0.75))
    samples = af.sample_mesh(v, f, 5000)
    report = af.deform(samples, [cases.moved(base), cases.moved(ball, turn)]).report
    assert report["loss"][0][1] < NEAR_THE_END * report["loss"][-1][1]
    assert report["iterations"] < 100  # where a preconditioner misses samples it takes all 300


def end_distance(samples, end, turn):
    """Mean square of what the moved handle asks of its samples, over both handles, in the cube."""
    inside = samples.points[np.abs((samples.points - end[:3, 3]) / np.diag(end)[:3]).max(1) <= 1]
    way = inside @ turn[:3, :3].T + turn[:3, 3] - inside
    return (way**2).sum(1).mean() / 2 / samples.frame.scale**2


def test_exact_handles_cost_little(bar, handles, radial, tmp_path):
    """Followed to rounding, for little more energy than the soft handles, which stay behind."""
    exact = af.deform(bar, handles, af.DeformOptions(field="radial", exact_handles=True))
    assert exact.report["handle_error_max"] < 1e-9 < radial.report["handle_error_mean"]
    assert exact.report["energy"] < EXACT_PRICE * radial.report["energy"]
    assert exact.report["flipped_share"] == 0
    exact.save(tmp_path / "exact.safetensors")
    again = af.DeformationField.load(tmp_path / "exact.safetensors")
    assert np.array_equal(again(bar.points[:50]), exact(bar.points[:50]))


def test_stylize_radial_turns_normals_and_stands_where_it_stood(bar):
    cube = af.preferred_normals("cube") @ turned(15, 0)[:3, :3].T
    before = af.gauss_preference(bar.normals, cube).mean()
    options = af.StylizeOptions(field="radial", iterations=30)
    field = af.stylize(bar, cube, options)
    assert field.report.preference > before + 0.1
    assert field.report.flipped_share == 0
    motion = field(bar.points) - bar.points
    assert abs(motion[bar.points[:, 2].argmin(), 2]) < 1e-9
    assert np.abs(motion[:, :2].mean(axis=0)).max() < 5e-3  # by some of the samples
    unchanged = af.stylize(bar, cube, af.StylizeOptions(field="radial", strength=0.0))
    assert np.abs(unchanged(bar.points) - bar.points).max() < 1e-6


def test_limits_of_a_radial_field_are_named(bar, handles):
    with pytest.raises(af.InvalidInput, match=r"needs? field='neural'"):
        af.deform(bar, handles, af.DeformOptions(field="radial", invertibility=1.0))
    with pytest.raises(af.InvalidInput, match="'radial', 'neural' or 'invertible'"):
        af.stylize(bar, "cube", af.StylizeOptions(field="splines"))


def test_cancel_stops_a_radial_solve(bar, handles):
    task = af.Task()
    task.cancel()
    with pytest.raises(af.Cancelled):
        af.deform(bar, handles, af.DeformOptions(field="radial"), task=task)


def test_few_samples_carry_few_centers(handles):
    """Between 600 samples of a bar, a thousand centers would fold space."""
    field = af.deform(bar_samples(count=600), handles)
    assert field.report.flipped_share == 0.0
    assert af.distortion(field, bar_samples().points).flipped_share == 0.0


def test_a_field_is_restored_from_its_arrays(bar):
    """The formula of `arrays`, in NumPy; the test in Blender evaluates interior distances as well."""
    held = af.PointHandle([0.0, 0.0, 0.5], [0.0, 0.0, 0.8], reach=0.6)
    field = af.LiveDeformer(bar, [held]).solve([[0.0, 0.0, 0.8]])
    arrays = field.arrays()
    cube = (bar.points[:300] - field.frame.center) / field.frame.scale
    squares = ((cube[:, None] - arrays["centers"]) ** 2).sum(axis=2) / arrays["radii"] ** 2
    moved = np.maximum(0, 1 - squares / 6) ** 6 @ arrays["coefficients"]
    moved += arrays["affine"][0] + cube @ arrays["affine"][1:]
    reaches = np.linalg.norm(cube[:, None] - arrays["places"], axis=2) / arrays["reaches"]
    t = np.clip(2 * reaches - 1, 0, 1)
    beyond = (t**4 * (35 - 84 * t + 70 * t**2 - 20 * t**3)).prod(axis=1, keepdims=True)
    moved = cube + (1 - beyond) * (moved - cube)
    expected = moved * field.frame.scale + field.frame.center
    assert np.abs(field(bar.points[:300]) - expected).max() < 1e-12


# Inverses: trained networks, Newton's on published shapes, and the cycle loss beside a deformation.


@pytest.fixture(scope="module")
def bent_field(samples):
    options = af.DeformOptions(width=32, layers=3, iterations=80, batch=100, handle_batch=50)
    return af.deform(samples, cases.bar_handles(), options)


def test_a_trained_inverse_returns(bent_field, samples):
    inverse = af.train_inverse(
        bent_field, samples, af.InverseTrainingOptions(width=64, layers=3, iterations=300, batch=300)
    )
    others = cases.bar_samples(500, seed=9).points
    error = np.linalg.norm(inverse(bent_field(others)) - others, axis=1)
    moved = np.linalg.norm(bent_field(others) - others, axis=1)
    assert np.quantile(error, 0.95) < 0.02 * moved.max()
    assert inverse.report.error_mean == pytest.approx(error.mean(), rel=0.2)


def test_what_is_infinitely_far_has_no_preimage(bent_field):
    """Squares of such distances overflow."""
    assert np.isnan(bent_field.inverse(np.array([[1e300, 0.0, 0.0]]))).all()


def test_a_trained_inverse_is_a_field_with_a_file(bent_field, samples, tmp_path):
    inverse = af.train_inverse(
        bent_field, samples, af.InverseTrainingOptions(width=16, layers=2, iterations=5, batch=50)
    )
    inverse.save(tmp_path / "inverse.safetensors")
    again = af.DeformationField.load(tmp_path / "inverse.safetensors")
    assert np.array_equal(again(samples.points), inverse(samples.points))
    assert inverse.frame == bent_field.frame


def test_bad_options_are_named(bent_field, samples):
    with pytest.raises(af.InvalidInput, match="batch"):
        af.train_inverse(bent_field, samples, af.InverseTrainingOptions(batch=0))
    with pytest.raises(af.InvalidInput, match="device"):
        af.train_inverse(bent_field, samples, af.InverseTrainingOptions(device="abacus"))


def test_invertibility_penalises_folds(samples):
    """A strong push, which folds the bar unless an inverse must keep up."""
    left, right = (h.rest for h in cases.bar_handles())
    handles = [cases.moved(left), cases.moved(right, cases.shift([-1.0, 0.0, 0.0]))]
    settings = dict(width=32, layers=3, iterations=250, batch=100, handle_batch=50, bending=0.0)
    settings |= dict(optimizer="adam", learning_rate=5e-3)
    free = af.deform(samples, handles, af.DeformOptions(**settings)).report
    kept = af.deform(samples, handles, af.DeformOptions(invertibility=100.0, **settings)).report
    assert free["min_determinant"] < 0.0
    assert kept["min_determinant"] > free["min_determinant"]
    assert kept["flipped_share"] < free["flipped_share"]


@pytest.mark.parametrize("kind", ["radial", "neural"])
@pytest.mark.parametrize("unit", [1e-4, 1.0, 1e4])
def test_newtons_inverse_in_any_unit(unit, kind):
    """The same bar in other units of length and off the origin: all points come back, as exactly."""
    small = cases.bar_samples(400)
    frame = af.Frame([3.0 * unit, -unit, 2.0 * unit], unit)
    samples = af.SurfaceSamples(frame.to_mesh(small.points), small.normals, frame=frame)
    place = cases.shift(frame.center) @ np.diag([unit, unit, unit, 1.0])
    handles = [af.Cuboid(place @ h.rest, place @ h.target) for h in cases.bar_handles()]
    settings = dict(width=32, layers=3, iterations=60, batch=100, handle_batch=50)
    field = af.deform(samples, handles, af.DeformOptions(field=kind, **settings))
    error = np.linalg.norm(field.inverse(field(samples.points)) - samples.points, axis=1) / unit
    assert not np.isnan(error).any()
    assert np.quantile(error, 0.95) < tolerances.NEWTON_INVERSE


def gap_in_voxels(sdf, field, resolution, **keywords):
    """Symmetric Hausdorff distance, at vertices, of extract_deformed and the warped extraction."""
    mesh = af.extract_deformed(sdf, field, resolution, **keywords)
    (V, F), report = mesh, mesh.report
    rest, G = af.extract_surface(sdf, resolution)
    W = field(rest)
    apart = max(np.abs(af.signed_distance(W, G, V)).max(), np.abs(af.signed_distance(V, F, W)).max())
    return apart / report.spacing, report


@pytest.fixture(scope="module")
def bunny(data_dir):
    """The published bunny, bent_field by a radial field until an ear runs into the back."""
    path = data_dir / "neural_sdf" / "bunny.pt"
    sdf = af.NeuralSdf.from_layers(*Network.published(path).layers)
    samples = af.sample_surface(sdf, count=2000)
    return sdf, af.deform(samples, cases.bunny_handles(), af.DeformOptions(field="radial", locality=0))


def test_extraction_through_newtons_inverse(bunny):
    sdf, field = bunny
    apart, report = gap_in_voxels(sdf, field, 40)
    assert apart <= 1.5
    assert report.failures < 0.05 * report.inverted and not report.open
    assert report.inverted < report.dense_evaluations / 2


def test_extraction_stops_and_names_bad_input(bunny):
    sdf, field = bunny
    with pytest.raises(af.InvalidInput, match="resolution"):
        af.extract_deformed(sdf, field, 5)
    with pytest.raises(af.InvalidInput, match="threads"):
        af.extract_deformed(sdf, field, 32, threads=-1)
    task = af.Task()
    with cancelled_when(task, lambda seen: task.progress >= 0.2) as seen, pytest.raises(af.Cancelled):
        af.extract_deformed(sdf, field, 96, task=task)
    assert seen == sorted(seen)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bunny", "spot", "whale"])
def test_inverses_on_published_shapes(data_dir, name):
    """A bend by 40 degrees; Newton's inverse and a trained one, at uniform points and in extraction."""
    samples = cases.published_samples(data_dir / "neural_sdf" / f"{name}.pt")
    low, high = samples.points.min(0) - 0.01, samples.points.max(0) + 0.01
    axis = int(np.argmax(high - low))
    ends = []
    for begin, end in ((0.0, 0.3), (0.7, 1.0)):
        a, b = low.copy(), high.copy()
        a[axis], b[axis] = low[axis] + np.array([begin, end]) * (high - low)[axis]
        ends.append(cases.box(a, b))
    bend = cases.turn(np.eye(3)[(axis + 1) % 3], 40, (low + high) / 2)
    handles = [cases.moved(ends[0]), cases.moved(ends[1], bend)]
    field = af.deform(samples, handles, af.DeformOptions(iterations=100, locality=0))
    points = cases.published_samples(data_dir / "neural_sdf" / f"{name}.pt", 5000, seed=1).points
    images = field(points)
    error = np.linalg.norm(field.inverse(images) - points, axis=1)
    assert np.isnan(error).mean() <= 0.01
    assert np.nanquantile(error, 0.95) < tolerances.NEWTON_INVERSE
    sdf = af.NeuralSdf.from_layers(*Network.published(data_dir / "neural_sdf" / f"{name}.pt").layers)
    apart, report = gap_in_voxels(sdf, field, 128)
    assert apart <= 1.5 and report.failures <= 0.01 * report.inverted
    trained = af.train_inverse(field, samples, af.InverseTrainingOptions(iterations=1500))
    assert gap_in_voxels(sdf, field, 128, inverse=trained)[0] <= 1.5
    assert np.quantile(np.linalg.norm(trained(images) - points, axis=1), 0.95) < 1e-3


class Turtle(af.ImplicitFunction):
    """A flat shell with thin flippers, a head and a tail: ellipsoids (center, radii)."""

    PARTS = np.array(
        [[[0, 0, 0], [0.7, 0.5, 0.22]]]
        + [[[0.85, 0, 0.02], [0.2, 0.12, 0.1]], [[-0.8, 0, 0], [0.2, 0.04, 0.03]]]
        + [[[x, y, -0.05], [0.16, abs(y) / 2, 0.035]] for x in (0.45, -0.55) for y in (0.6, -0.6)]
    )

    def __init__(self):
        super().__init__(af.Frame([0, 0, 0], 1.3))

    def __call__(self, points):
        away = (points[:, None] - self.PARTS[:, 0]) / self.PARTS[:, 1]
        return ((np.linalg.norm(away, axis=2) - 1) * self.PARTS[:, 1].min(axis=1)).min(axis=1)


@pytest.mark.parametrize("style", ["octahedron", "dodecahedron"])
def test_every_point_of_a_styled_turtle_comes_back(style):
    """Where thin parts lie close together, the nearest image is not of the nearest part."""
    rest, triangles = af.extract_surface(Turtle(), 72)
    samples = af.sample_mesh(rest, triangles, 1200)
    field = af.stylize(samples, style, af.StylizeOptions(field="radial", strength=0.3))
    images = field(rest)
    found = field.inverse(images)
    assert not np.isnan(found).any()
    assert np.abs(field(found) - images).max() < 1e-5
