# SPDX-License-Identifier: GPL-3.0-or-later
"""deform: what it reaches, handles, options, bad input, cancelling, repeatability."""

import json
import threading

import numpy as np
import pytest
import trimesh
from support import tolerances
from support.geometry import cases, meshes
from support.geometry.meshes import sphere
from support.programs.cli import run

import arapfields as af

# deform: what it reaches, rigid motions, exact handles, options, bad input, cancelling, repeatability.


@pytest.fixture(scope="module")
def samples():
    return cases.bar_samples()


def quick(**changes):
    settings = dict(width=32, layers=3, iterations=120, batch=100, handle_batch=50)
    return af.DeformOptions(**(settings | changes))


def test_handles_follow_and_the_rest_bends_smoothly(samples):
    field = af.deform(samples, cases.bar_handles(), quick(iterations=250))
    report = field.report
    assert report.handle_error_mean < 0.02
    assert report.stretch < 0.05 and report.flipped_share == 0.0 and report.min_determinant > 0.3
    stretch, bend = af.arap_energy(field, samples.points)
    assert stretch == pytest.approx(report.stretch, rel=1e-6)
    assert bend == pytest.approx(report.bend, rel=1e-6)
    assert stretch < report.energy < 2 * stretch  # with what the bend adds: test_stiffness.py
    assert [h.error_mean for h in report.handles] == pytest.approx(
        2 * [report.handle_error_mean], abs=report.handle_error_max
    )
    assert report.loss[-1][1] < 0.3 * report.loss[0][1]


def test_no_motion_is_the_identity(samples):
    """The start is the optimum already: nothing may move."""
    rest = cases.box([-0.9, -0.3, -0.3], [-0.6, 0.3, 0.3])
    field = af.deform(samples, [cases.moved(rest)], quick(iterations=20))
    assert np.abs(field(samples.points) - samples.points).max() < 1e-5


def test_rigid_motion_of_a_solution_changes_no_energy(samples):
    """f and C∘f have the same energies: the derivatives of a turned copy, fed to the same formula."""
    field = af.deform(samples, cases.bar_handles(), quick())
    points = samples.points[:500]
    from arapfields._native import testing

    jets = np.zeros((10, len(points), 3))
    jets[0], jacobian, hessian = field(points), field.jacobian(points), field.hessian(points)
    jets[1:4] = np.moveaxis(jacobian, 2, 0)
    for column, (j, k) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]):
        jets[4 + column] = hessian[:, :, j, k]
    before = testing.arap_energy(jets, 0.01, 1.0)[:2]
    rotation = cases.turn([1, 2, 3], 77.0)[:3, :3]
    after = testing.arap_energy(np.ascontiguousarray(jets @ rotation.T), 0.01, 1.0)[:2]
    assert after == pytest.approx(before, rel=tolerances.RIGID_INVARIANCE)
    assert before == pytest.approx(af.arap_energy(field, points), rel=1e-6)


@pytest.mark.parametrize("motion", ["shift", "turn"])
def test_exact_handles_interpolate(samples, motion):
    left, right = (h.rest for h in cases.bar_handles())
    matrix = cases.shift([0, 0.1, 0.2]) if motion == "shift" else cases.turn([1, 1, 0], 40, (0.5, 0, 0))
    field = af.deform(samples, [cases.moved(left), cases.moved(right, matrix)], quick(exact_handles=True))
    assert field.report.handle_error_max < tolerances.EXACT_HANDLE
    assert field.report.flipped_share == 0.0
    inside = np.abs((samples.points - right[:3, 3]) @ np.linalg.inv(right[:3, :3]).T).max(1) <= 1
    expected = samples.points[inside] @ matrix[:3, :3].T + matrix[:3, 3]
    assert np.abs(field(samples.points[inside]) - expected).max() < tolerances.EXACT_HANDLE


def test_exact_handles_that_overlap_are_named(samples):
    a = cases.box([-0.9, -0.3, -0.3], [0.1, 0.3, 0.3])
    b = cases.box([-0.1, -0.3, -0.3], [0.9, 0.3, 0.3])
    with pytest.raises(af.InvalidInput, match=r"handles\[0\] and handles\[1\].*overlap"):
        af.deform(
            samples, [cases.moved(a), cases.moved(b, cases.shift([0, 0, 0.1]))], quick(exact_handles=True)
        )
    together = cases.shift([0, 0, 0.1])
    field = af.deform(
        samples, [cases.moved(a, together), cases.moved(b, together)], quick(exact_handles=True, margin=0.1)
    )
    assert field.report.handle_error_max < tolerances.EXACT_HANDLE


def test_exact_handles_that_nearly_overlap_stay_exact_and_are_named(samples):
    a = cases.box([-0.9, -0.3, -0.3], [-0.03, 0.3, 0.3])
    b = cases.box([0.03, -0.3, -0.3], [0.9, 0.3, 0.3])
    handles = [cases.moved(a), cases.moved(b, cases.turn([0, 1, 0], 20))]
    field = af.deform(samples, handles, quick(exact_handles=True, margin=0.1))
    assert field.report.handle_error_max < tolerances.EXACT_HANDLE
    assert "handles[0] and handles[1]" in field.report.notes[0]


def test_points_and_regions(samples):
    """A region's samples move with it; a point handle, exact, arrives."""
    left = cases.bar_handles()[0].rest
    listed = np.flatnonzero(samples.points[:, 0] > 0.7)
    lift = cases.shift([0.0, 0.0, 0.1])
    region = af.Region(listed.tolist(), np.eye(4), lift)
    field = af.deform(samples, [cases.moved(left), region], quick(iterations=250))
    assert np.abs(field(samples.points[listed]) - samples.points[listed] - [0, 0, 0.1]).max() < 0.05
    tip = [0.8, 0.0, 0.0]
    point = af.Point(tip, [0.8, 0.0, 0.1])
    field = af.deform(samples, [cases.moved(left), point], quick(exact_handles=True))
    assert np.abs(field([tip])[0] - point.target).max() < tolerances.EXACT_HANDLE
    with pytest.raises(af.InvalidInput, match=r"handles\[0\].*region"):
        af.deform(samples, [region], quick(exact_handles=True))


def test_a_heavier_handle_is_followed_more_closely(samples):
    left, right = (h.rest for h in cases.bar_handles())
    pull = cases.shift([0.3, 0, 0])
    errors = []
    for weight in (0.02, 1.0):
        handles = [cases.moved(left), cases.moved(right, pull, weight=weight)]
        errors.append(af.deform(samples, handles, quick(handle_weight=10.0)).report.handles[1].error_mean)
    assert errors[1] < 0.5 * errors[0]


def test_the_barrier_unfolds(samples):
    """Pushed through itself, the bar folds; the barrier keeps det J up."""
    left, right = (h.rest for h in cases.bar_handles())
    handles = [cases.moved(left), cases.moved(right, cases.shift([-1.45, 0.0, 0.0]))]
    settings = dict(bending=0.0, iterations=250, optimizer="adam", learning_rate=5e-3)
    free = af.deform(samples, handles, quick(**settings)).report
    kept = af.deform(samples, handles, quick(barrier=10.0, **settings)).report
    assert free["flipped_share"] > 0.0 and free["min_determinant"] < 0.0
    assert kept["flipped_share"] == 0.0 and kept["min_determinant"] > 0.0


def test_same_seed_same_result(samples):
    options = quick(iterations=30)
    first, second = (af.deform(samples, cases.bar_handles(), options) for _ in range(2))
    other = af.deform(samples, cases.bar_handles(), quick(iterations=30, seed=1))
    points = samples.points[:50]
    assert np.array_equal(first(points), second(points))
    assert not np.array_equal(first(points), other(points))


@pytest.mark.parametrize("changes", [dict(field="radial"), dict(start="radial", iterations=20)], ids=str)
def test_radial_fields_and_starts(samples, changes):
    """Bumps alone, and a network on top of them, bend the bar as the network alone does."""
    field = af.deform(samples, cases.bar_handles(), quick(centers=80, **changes))
    alone = af.deform(samples, cases.bar_handles(), quick(iterations=250))
    assert field.report.handle_error_mean < 0.02
    assert field.report.energy < 1.5 * alone.report.energy
    middle = samples.points[np.abs(samples.points[:, 0]) < 0.5]
    assert np.abs(field(middle) - alone(middle)).max() < 0.1


def test_both_optimizers_descend(samples):
    for optimizer in ("muon", "adam"):
        loss = af.deform(samples, cases.bar_handles(), quick(optimizer=optimizer)).report.loss
        assert np.mean([l for _, l in loss[-10:]]) < 0.1 * loss[0][1]


def test_a_task_changes_nothing_and_sees_progress(samples):
    task = af.Task()
    options = quick(iterations=30)
    with_task = af.deform(samples, cases.bar_handles(), options, task=task)
    without = af.deform(samples, cases.bar_handles(), options)
    assert np.array_equal(with_task(samples.points[:9]), without(samples.points[:9]))
    assert task.progress == 1.0 and task.message == "done"


def test_cancel_from_another_thread(samples):
    task = af.Task()
    timer = threading.Timer(0.3, task.cancel)
    timer.start()
    with pytest.raises(af.Cancelled):
        af.deform(samples, cases.bar_handles(), quick(iterations=10_000_000), task=task)
    assert 0.0 < task.progress < 0.1


def test_time_budget_ends_the_run(samples):
    field = af.deform(samples, cases.bar_handles(), quick(iterations=10_000_000, time_budget=0.5))
    assert field.report.out_of_time and 0 < field.report.iterations < 10_000_000


NETWORKS = {"neural": {}, "with its inverse": {"invertibility": 1.0}, "invertible": {"field": "invertible"}}


@pytest.mark.parametrize("iterations", [1, 2, 11])
@pytest.mark.parametrize("optimizer", ["muon", "adam"])
@pytest.mark.parametrize("kind", [*NETWORKS, "style", "inverse"])
def test_steps_to_infinity_end_in_numbers_or_a_divergence(samples, kind, optimizer, iterations):
    wild = dict(iterations=iterations, learning_rate=1e30, optimizer=optimizer, width=16, layers=2, batch=20)
    try:
        if kind == "style":
            kept = af.stylize(samples, "cube", af.StylizeOptions(field="neural", **wild))
        elif kind == "inverse":
            field = af.deform(samples, cases.bar_handles(), af.DeformOptions(iterations=3))
            kept = af.train_inverse(field, samples, af.InverseTrainingOptions(**wild))
        else:
            options = af.DeformOptions(**{"field": "neural"} | NETWORKS[kind] | wild)
            kept = af.deform(samples, cases.bar_handles(), options)
    except af.Diverged as error:
        assert "learning_rate" in str(error)
        kept = error.last_good
    assert np.isfinite(kept(samples.points)).all() and np.isfinite(kept.hessian(samples.points)).all()
    figures = [value for value in kept.report.to_dict().values() if isinstance(value, float)]
    assert figures and np.isfinite(figures).all()


def test_divergence_keeps_the_last_good_state(samples):
    with pytest.raises(af.Diverged, match="iteration") as caught:
        af.deform(samples, cases.bar_handles(), quick(learning_rate=1e30, optimizer="adam"))
    assert np.isfinite(caught.value.last_good(samples.points)).all()


@pytest.mark.parametrize(
    "changes",
    [
        dict(iterations=-1),
        dict(batch=0),
        dict(bending=-1.0),
        dict(learning_rate=-1.0),
        dict(optimizer="newton"),
        dict(field="radial", centers=1),
        dict(field="splines"),
        dict(start="nowhere"),
        dict(device="abacus"),
        dict(threads=-1),
        dict(width=0),
        dict(octaves=-1),
        dict(sharpness=float("nan")),
        dict(margin=0.0, exact_handles=True),
    ],
)
def test_bad_options_are_named(samples, changes):
    with pytest.raises(af.InvalidInput, match="|".join(changes)):
        af.deform(samples, cases.bar_handles(), quick(**changes))


def test_bad_handles_are_named(samples):
    rest = cases.box([-0.9, -0.3, -0.3], [-0.6, 0.3, 0.3])
    with pytest.raises(af.InvalidInput, match="handles"):
        af.deform(samples, [], quick())
    with pytest.raises(af.InvalidInput, match=r"handles\[1\].*no surface sample"):
        af.deform(samples, [cases.moved(rest), cases.moved(cases.box([2, 2, 2], [3, 3, 3]))], quick())
    with pytest.raises(af.InvalidInput, match="scales or shears"):
        cases.moved(rest, np.diag([2.0, 1.0, 1.0, 1.0]))
    with pytest.raises(af.InvalidInput, match="mirror"):
        cases.moved(rest, np.diag([-1.0, 1.0, 1.0, 1.0]))
    with pytest.raises(af.InvalidInput, match="rest"):
        af.Cuboid(np.eye(3), np.eye(4))
    with pytest.raises(TypeError):
        af.deform(samples.points, [cases.moved(rest)], quick())


@pytest.mark.slow
def test_the_bunnys_figures(data_dir):
    """The reference case: 300 iterations of the 4×256 network."""
    samples = cases.published_samples(data_dir / "neural_sdf" / "bunny.pt")
    report = af.deform(samples, cases.bunny_handles(), af.DeformOptions(iterations=300)).report
    assert report.energy <= 0.0285 and report.handle_error_mean <= 0.005
    assert report.flipped_share == 0.0


@pytest.mark.slow
def test_the_bunny_with_exact_handles(data_dir):
    samples = cases.published_samples(data_dir / "neural_sdf" / "bunny.pt")
    options = af.DeformOptions(iterations=400, exact_handles=True, width=128)
    report = af.deform(samples, cases.bunny_handles(), options).report
    assert report.energy <= 0.050 and report.handle_error_max <= tolerances.EXACT_HANDLE
    assert report.flipped_share == 0.0


# The bending weight trades bend for stretch, monotonically.

WEIGHTS = [0.0, 0.1, 1.0, 10.0]


def check_trade(samples, handles, **options):
    """Stretch rises and bend falls with the weight."""
    fields = [
        af.deform(samples, handles, af.DeformOptions(bending=w, locality=0, **options)) for w in WEIGHTS
    ]
    stretch, bend = np.transpose([af.arap_energy(field, samples.points) for field in fields])
    assert (np.diff(bend) < 0).all(), (stretch, bend)
    assert (np.diff(stretch) > 0).all(), (stretch, bend)


def test_on_a_bar_by_bumps():
    check_trade(cases.bar_samples(3000), cases.bar_handles(), field="radial", centers=150)


@pytest.mark.slow
def test_on_a_bar():
    check_trade(cases.bar_samples(6000), cases.bar_handles(), width=128)


@pytest.mark.slow
def test_on_the_published_hand(data_dir):
    samples = cases.published_samples(data_dir / "neural_sdf" / "hand.pt")
    check_trade(samples, cases.hand_handles(), width=128)


# Exact handles of a radial field: interpolated, at little more energy than soft ones.

# A bend's energy with exact handles over that with soft ones, which may miss them.
MOST_OVER_SOFT = 1.2


def test_the_price_of_a_bar():
    samples = cases.bar_samples(3000)
    energies = [
        af.deform(samples, cases.bar_handles(), af.DeformOptions(exact_handles=exact, centers=300)).report
        for exact in (False, True)
    ]
    assert energies[1].handle_error_max < tolerances.EXACT_HANDLE
    assert energies[0].energy < energies[1].energy < MOST_OVER_SOFT * energies[0].energy
    assert energies[1].flipped_share == 0.0


def test_many_centers_stay_in_their_range():
    """Exact handles take more centers than were asked for, but never more than a solver can have."""
    options = af.DeformOptions(exact_handles=True, centers=2300, iterations=1)
    field = af.deform(cases.bar_samples(25_000), cases.bar_handles(), options)
    assert field.report.handle_error_max < tolerances.EXACT_HANDLE


# Point handles beside the surface: they move its nearest place and say so, or are refused.

SHIFT = np.array([0.3, 0, 0])


@pytest.mark.parametrize("off", [0.6, 1.2, 5.0])
def test_a_point_off_the_surface_moves_it_and_says_so_or_is_refused(off):
    """A ball of radius 1: within half its size of 2 a point stands for the surface's nearest place."""
    directions = np.random.default_rng(0).normal(size=(800, 3))
    ball = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    samples = af.SurfaceSamples(ball, ball)
    rest = np.array([0, 0, 1 + off])
    handles = [af.PointHandle([0, 0, -1], [0, 0, -1]), af.PointHandle(rest, rest + SHIFT)]
    live = lambda: af.LiveDeformer(samples, handles).solve([[0, 0, -1], rest + SHIFT])  # noqa: E731
    radial = lambda: af.deform(samples, handles, af.DeformOptions(field="radial"))  # noqa: E731
    for solve in (live, radial):
        if off > 1:
            with pytest.raises(af.InvalidInput, match=r"handles\[1\]: its point lies .* away from it"):
                solve()
            continue
        field = solve()
        assert field([[0, 0, 1.0]])[0, 0] > 0.25
        assert any("handles[1]" in note and "off the surface" in note for note in field.report.notes)


def test_the_command_line_refuses_it_too(tmp_path, capsys):
    trimesh.Trimesh(*sphere(1.0, 2), process=False).export(tmp_path / "ball.ply")
    handles = [{"type": "point", "rest": [0, 0, 6], "target": [1, 0, 6]}]
    (tmp_path / "handles.json").write_text(json.dumps(handles))
    given = [tmp_path / "ball.ply", "--handles", tmp_path / "handles.json", "-o", tmp_path / "x.ply"]
    assert run("deform", *given, "--field", "radial") == 2
    assert "handles[0]: its point lies" in capsys.readouterr().err and not (tmp_path / "x.ply").exists()


# Samples newly drawn from the surface at each step of a solve.


def test_fresh_samples_are_drawn_from_the_surface():
    V, F = meshes.torus(around=24, tube=12)
    box = np.diag([0.4, 3.0, 3.0, 1.0])
    here, moved = np.eye(4), np.eye(4)
    here[0, 3], moved[0, 3] = -1.0, 1.0
    lift = np.eye(4)
    lift[2, 3] = 0.5
    handles = [af.Cuboid(here @ box, here @ box), af.Cuboid(moved @ box, lift @ moved @ box)]
    few = af.sample_mesh(V, F, count=300, seed=1)
    settings = {"iterations": 12, "width": 16, "layers": 2, "seed": 3, "threads": 1}

    def solve(samples, fresh):
        return af.deform(samples, handles, af.DeformOptions(fresh_samples=fresh, **settings))(V)

    assert not np.array_equal(solve(few, 100), solve(few, 0))
    assert np.array_equal(solve(few, 100), solve(few, 100))
    with pytest.raises(af.InvalidInput, match="fresh_samples"):
        solve(af.SurfaceSamples(few.points, few.normals), 100)
    with pytest.raises(af.InvalidInput, match="fresh_samples"):
        solve(few, -1)


# The published hand, whose fingers are close in space and far along the surface.

# Fingers are a quarter of the cube apart: octaves from 4 to 128, whose bending a smaller weight must leave
# room for, at a smaller rate.
THIN_PARTS = dict(frequency=4.0, octaves=6, bending=0.1, bending_unit="cube", learning_rate=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_the_other_fingers_stay(data_dir, seed):
    """The middle finger goes by a third of the hand's length, the other tips by less than 2 % of it."""
    samples = cases.published_samples(data_dir / "neural_sdf" / "hand.pt")
    length = np.ptp(samples.points[:, 2])
    handles = cases.hand_handles()
    assert np.linalg.norm(handles[1].target - handles[1].rest) > 0.3 * length
    options = af.DeformOptions(width=128, iterations=600, seed=seed, **THIN_PARTS)
    field = af.deform(samples, handles, options)
    tips = cases.fingertips(samples)
    tips.pop("middle")
    for name, tip in tips.items():
        assert len(tip) > 50
        moved = np.linalg.norm(field(samples.points[tip]) - samples.points[tip], axis=1)
        assert moved.max() < 0.02 * length, name
    report = field.report
    assert report.handle_error_max < 0.01 * length and report.flipped_share == 0.0
    assert report.energy < 0.005


def with_ears(width):
    """A bar along x with three ears on top, narrow cones on which few samples lie."""
    bar = trimesh.creation.box((2.0, 0.4, 0.4))
    for _ in range(4):
        bar = bar.subdivide()
    vertices, triangles = np.array(bar.vertices), np.array(bar.faces)
    turns, rows = np.linspace(0, 2 * np.pi, 8, endpoint=False), 12
    for x in (-0.3, 0.0, 0.3):
        rings = [
            (x + r * np.cos(a), r * np.sin(a), 0.19 + 0.9 * i / rows)
            for i in range(rows)
            for r in [width * (1 - i / rows)]
            for a in turns
        ]
        start, last = len(vertices), 8 * rows
        faces = [(last - 8 + j, last - 8 + (j + 1) % 8, last) for j in range(8)]
        for i in range(0, last - 8, 8):
            for j in range(8):
                a, b = i + j, i + (j + 1) % 8
                faces += [(a, b, b + 8), (a, b + 8, a + 8)]
        vertices = np.vstack([vertices, rings, (x, 0.0, 1.09)])
        triangles = np.vstack([triangles, start + np.array(faces)])
    return vertices, triangles


@pytest.mark.parametrize("seed", [0, 1])
def test_no_place_of_the_mesh_is_free_to_fold_between_samples(seed):
    # Ears grew spikes of up to nineteen times their length, det J −114.
    vertices, triangles = with_ears(0.03)
    ends = [
        cases.moved(cases.box([-1.1, -1, -1], [-0.8, 1, 1])),
        cases.moved(cases.box([0.8, -1, -1], [1.1, 1, 1]), cases.turn([0, 1, 0], -80, (0, 0, 0))),
    ]
    field = af.deform(af.sample_mesh(vertices, triangles, 2000, seed=seed), ends)
    stretches = np.linalg.svd(field.jacobian(vertices[triangles].mean(axis=1)), compute_uv=False)
    assert np.linalg.det(field.jacobian(vertices[triangles].mean(axis=1))).min() > 0
    assert field.report.min_determinant > 0 and field.report.flipped_share == 0
    assert stretches.max() <= field.report.max_stretch + 1e-9 < 3.0  # above, the solve would go on
    assert not [note for note in field.report.notes if "fold" in note]
