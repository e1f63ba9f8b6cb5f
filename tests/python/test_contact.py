# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact: nothing enters an obstacle or another part, nothing is remembered, and off is as before."""

import numpy as np
import pytest
import trimesh
from support.geometry import contact_cases
from support.geometry.bar import LEFT, RIGHT, bar_samples, box, turned
from support.geometry.characters import FOOT, HIP, LEG, THICKNESS, trousers
from support.geometry.contact_bar import (
    ALIKE,
    BALL,
    BLOCK,
    DEEP,
    DEEPEST,
    PLATE,
    QUICK,
    SHEET,
    Plane,
    live,
    solid,
)

import arapfields as af
from arapfields.__main__ import main


@pytest.fixture(scope="module")
def samples():
    return bar_samples(16000)


@pytest.mark.parametrize("function", [BALL, BLOCK, PLATE, SHEET, Plane()])
def test_nothing_is_inside_an_obstacle(samples, function):
    pressed = live(samples, af.Contact([af.Obstacle(function)]))
    field = pressed.solve(DEEP, iterations=60, tolerance=1e-4)
    moved, points = field(samples.points), bar_samples(5000, seed=1).points
    rounded = live(samples, af.Contact([af.Obstacle(function)]))
    other = rounded.solve([LEFT, turned(0, shift=(0, 0, 1e-9)) @ DEEP[1]], iterations=60, tolerance=1e-4)
    assert np.abs(other(samples.points) - moved).max() < ALIKE
    depth = -np.asarray(function(field(points)))
    if function is SHEET:
        depth = np.where(field(points)[:, 0] > 0, -0.8 - field(points)[:, 2], 0)
    assert depth.max() < 1.5 * DEEPEST  # between the samples
    assert pressed.report.flipped_share == 0
    assert moved[:, 2].min() < -0.7
    if function not in (BALL, BLOCK):
        (held,) = pressed.report.contact.held
        assert held.handle == 1 and held.by == "obstacles[0]" and held.distance > 0.1
        assert "handles[1] is held back by obstacles[0]" in " ".join(pressed.report.notes)


def test_a_bar_on_a_ball_comes_to_rest_however_far_its_ends_go_down():
    """The energy grows with the way; a solve that did not end would hover above the ball."""
    mesh = trimesh.creation.box((1.9, 0.2, 0.2)).subdivide().subdivide().subdivide().subdivide()
    bar, ball = (
        af.sample_mesh(mesh.vertices, mesh.faces, 8000),
        solid(trimesh.creation.icosphere(4, 0.4), [0, 0, -0.52]),
    )
    ends = [box([side * 0.74, 0, 0], [0.09, 0.2, 0.2]) for side in (-1, 1)]
    shares = []
    for drop in np.linspace(0.08, 0.16, 6):
        down = turned(0, shift=(0, 0, -drop))
        handles = [af.Cuboid(end, down @ end) for end in ends]
        field = af.deform(
            bar, handles, af.DeformOptions(centers=200), contact=af.Contact([af.Obstacle(ball)])
        )
        assert abs(np.asarray(ball(field(bar.points))).min()) < DEEPEST
        shares.append(field.report.energy / drop**2)
    assert (np.diff(shares) > 0).all()


@pytest.mark.parametrize("itself", [False, True])
@pytest.mark.parametrize("kind", ["cuboid", "pin above", "pin beside"])
def test_a_handle_that_is_pulled_into_the_ground_gives_way(samples, kind, itself):
    """By 0.9, where the ground is 0.1 below the bar. A bar that is squashed has an energy over 0.1."""
    ends = [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, DEEP[1])]
    if kind != "cuboid":
        place = np.array([3.8, 0, 0.5] if kind == "pin above" else [3.8, -0.5, 0])
        ends[1] = af.Point(place, place - [0, 0, 0.9])
    pressed = af.LiveDeformer(samples, ends, QUICK, contact=af.Contact(ground=-0.6, itself=itself))
    field = pressed.solve(iterations=60)
    assert pressed.report.energy < 0.01 and pressed.report.flipped_share == 0
    assert -0.6 - DEEPEST < field(samples.points)[:, 2].min() < -0.6 + 2 * DEEPEST
    (held,) = pressed.report.contact.held
    assert held.handle == 1 and held.by == "ground" and held.distance == pytest.approx(0.8, abs=0.05)


def test_what_touches_nothing_is_as_without(samples):
    """Beside locality, which contact goes without."""
    far = af.Contact([af.Obstacle(BALL)], ground=-5.0, itself=True)
    up = [LEFT, turned(20, shift=(0, 0, 0.3)) @ RIGHT]
    assert (live(samples, far).solve(up)(samples.points) == live(samples).solve(up)(samples.points)).all()
    few = af.DeformOptions(centers=100, locality=0)
    handles = [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, up[1])]
    shapes = [af.deform(samples, handles, few, contact=c)(samples.points) for c in (None, far)]
    assert (shapes[0] == shapes[1]).all()


def overlapping(vertices, triangles):
    """Share of the vertices that lie inside another part, too."""
    normals = trimesh.Trimesh(vertices, triangles, process=False).vertex_normals
    return (np.abs(af.winding_number(vertices, triangles, vertices - 1e-3 * normals)) > 1.5).mean()


def test_crossed_legs_do_not_pass_each_other():
    vertices, triangles = af.extract_surface(trousers(), 48)[:2]
    samples = af.sample_mesh(vertices, triangles, 12000)
    trunk = box([0, 0, 1.1], [0.3, 0.3, 0.3])
    feet = [box([side * LEG, 0, FOOT], [0.1, 0.1, 0.1]) for side in (-1, 1)]
    crossed = [
        turned(0, shift=(2.4 * s * LEG, 0.03 * s, 0)) @ foot for s, foot in zip((1, -1), feet, strict=True)
    ]
    shares = []
    for itself in (False, True):
        live = af.LiveDeformer(
            samples, [af.Cuboid(m, m) for m in (trunk, *feet)], contact=af.Contact(itself=itself)
        )
        field = live.solve(
            [trunk, *crossed], iterations=200
        )  # to its end: before, what touches comes and goes
        shares.append(overlapping(field(vertices), triangles))
    assert shares[0] > 0.01 and shares[1] == 0
    assert live.report.flipped_share == 0 and live.report.handle_error_max < 0.05 * HIP
    assert live.report.contact.touching > 0
    again = live.solve([trunk, *feet], iterations=60, tolerance=1e-6)(vertices)
    assert np.abs(again - vertices).max() < 1e-3 * HIP


def test_what_overlaps_at_rest_is_left_alone(samples):
    other = samples.points @ np.diag([0.3, 0.3, 0.3]) + [0, 0, 0.6]
    both = af.SurfaceSamples(np.vstack([samples.points, other]), np.vstack([samples.normals] * 2))
    shapes = [
        live(both, contact).solve([LEFT, turned(10) @ RIGHT])(both.points)
        for contact in (None, af.Contact(itself=True))
    ]
    assert np.abs(shapes[0] - shapes[1]).max() < 1e-6


def test_the_command_line_asks_for_the_same(tmp_path, capsys):
    mesh, ball, out = (str(tmp_path / name) for name in ("bar.ply", "ball.ply", "out.ply"))
    bar = trimesh.creation.box((4, 1, 1)).subdivide().subdivide().subdivide().subdivide()
    bar.export(mesh)
    trimesh.creation.icosphere(3, 0.5).apply_translation([1.2, 0, -1.2]).export(ball)
    down = [
        "--box",
        "-inf,-inf,-inf",
        "-1.5,inf,inf",
        "--box",
        "1.5,-inf,-inf",
        "inf,inf,inf",
        "--shift",
        "0,0,-0.9",
    ]
    flags = ["--centers", "60", "--obstacle", f"{ball}:0.05", "--ground", "z", "-1", "--itself", "--quiet"]
    assert main(["deform", mesh, "-o", out, *down, *flags]) == 0
    low = trimesh.load(out).vertices
    assert np.asarray(BALL(low)).min() > 0.05 - 2 * DEEPEST and low[:, 2].min() > -1 - DEEPEST
    for wrong, text in (
        (["--ground", "up", "1"], "is not an axis"),
        (["--obstacle", ball + ":-1"], "margin"),
    ):
        assert main(["deform", mesh, "-o", out, *down, *wrong]) == 2
        assert text in capsys.readouterr().err


def test_a_drag_through_and_back_leaves_nothing(samples):
    dragged = live(samples, af.Contact([af.Obstacle(PLATE)]))
    start = dragged.solve([LEFT, RIGHT], iterations=60)(samples.points)
    for share in (0.3, 0.6, 1.0, 0.6, 0.3, 0.0):
        dragged.follow([LEFT, turned(0, shift=(0, 0, -1.4 * share)) @ RIGHT], iterations=4)
    end = dragged.solve(iterations=60, tolerance=1e-6)(samples.points)
    assert np.abs(end - start).max() < 4e-3


def test_deform_keeps_its_margin_and_says_what_is_held(samples):
    handles = [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, DEEP[1])]
    contact = af.Contact([af.Obstacle(BALL, 0.05)], ground=-1.0)
    field = af.deform(samples, handles, af.DeformOptions(centers=200, handle_weight=100), contact=contact)
    assert np.asarray(BALL(field(samples.points))).min() > 0.05 - DEEPEST
    assert field(samples.points)[:, 2].min() > -1.0 - DEEPEST
    assert field.report.contact.held[0].handle == 1 and field.report.contact.touching > 0


def test_what_cannot_be_is_named(samples):
    handles = [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)]
    with pytest.raises(af.InvalidInput, match="margin"):
        af.Obstacle(BALL, -1)
    with pytest.raises(af.InvalidInput, match="function"):
        af.Obstacle("ball")
    with pytest.raises(af.InvalidInput, match="ground"):
        af.Contact(ground=np.nan)
    touch = af.Contact([af.Obstacle(BALL)])
    with pytest.raises(af.InvalidInput, match="exact handles"):
        af.deform(samples, handles, af.DeformOptions(centers=50, exact_handles=True), contact=touch)
    with pytest.raises(af.InvalidInput, match="field='radial'"):
        af.deform(samples, handles, af.DeformOptions(field="neural"), contact=touch)


@pytest.mark.parametrize("kind", ["cuboid", "pin"])
def test_a_handle_gives_way_where_its_reflection_alone_meets_something(kind):
    samples = af.sample_surface(trousers(), 6000, seed=0)
    trunk, foot = box([0, 0, 1.1], [0.3, 0.3, 0.3]), box([LEG, 0, FOOT], [0.1, 0.1, 0.1])
    way, side_of_leg = np.array([0.3, 0, 0]), np.array([LEG + THICKNESS, 0, FOOT])
    handles = [af.Cuboid(trunk, trunk), af.Cuboid(foot, turned(0, shift=way) @ foot)]
    if kind == "pin":
        handles[1] = af.Point(side_of_leg, side_of_leg + way)
    reach = LEG + THICKNESS + 0.05
    found = []
    for side in (1, -1):
        wall = solid(trimesh.creation.box((0.2, 1, 1)), [side * (reach + 0.1), 0, 0])
        contact = af.Contact([af.Obstacle(wall)])
        pressed = af.LiveDeformer(samples, handles, af.LiveOptions(symmetry="x"), contact=contact)
        field = pressed.solve(iterations=60)
        assert np.abs(field(samples.points)[samples.points[:, 2] < 0.4, 0]).max() < reach + HIP * 2e-3
        assert pressed.report.flipped_share == 0
        (held,) = pressed.report.contact.held
        assert held.handle == 1 and held.by == "obstacles[0]"
        found.append((held.distance, pressed.report.energy))
    assert found[1] == pytest.approx(found[0], rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["spot on box 0", "bunny on edge 0", "bunny on sheet 0", "rockerArm on moving plate 0"]
)
def test_no_vertex_of_many_is_deep(name):
    from benchmarks import contact, shapes

    (case,) = [case for case in contact_cases.family(str(shapes.data())) if case.name == name]
    row, _ = contact.measure(case)
    assert row["deep"] < 0.1 and row["flipped"] == 0


def test_a_report_is_of_the_planes_found_last():
    """A fuzz net's calls: the last search finds more planes, and the process ended in the report."""
    rows = np.random.default_rng(2).normal(size=(60, 3))
    samples = af.SurfaceSamples(rows, rows / np.linalg.norm(rows, axis=1, keepdims=True))
    handle, up, few = af.Point(rows[0], rows[0] + 0.1), np.ones(3), {"iterations": 2, "tolerance": 0.1}
    options = af.LiveOptions(samples=50, coarse_centers=5, fine_centers=5, iterations=2, threads=1)
    live = af.LiveDeformer(samples, [handle], options)
    live.set_secondary_motion(af.SecondaryMotionOptions(), up=up, ground=1e6)
    live.step([rows[1]], 0.01)
    live.set_style("cube", 0.5, sharpness=5.0, up=up)
    live.set_symmetry("x")
    live.set_contact(af.Contact(ground=-1.0))
    live.solve([rows[1]], **few)
    live.set_secondary_motion(af.SecondaryMotionOptions(), up=up, ground=-2.0)
    live.set_handles([handle])
    assert np.isfinite(live.solve([rows[1]], **few)(rows)).all()


@pytest.mark.parametrize(
    ("contact", "named"),
    [
        (lambda: af.Contact([af.Obstacle(BALL, margin=1e300)]), r"obstacles\[0\]\.margin: 1e\+300"),
        (
            lambda: af.Contact([af.Obstacle(BALL), af.Obstacle(BALL, margin=1e30)]),
            r"obstacles\[1\]\.margin: 1e\+30",
        ),
        (lambda: af.Contact(ground=1e8), r"ground: 1e\+08 above the shape"),
        (lambda: af.Contact(ground=1e30), r"ground: 1e\+30 above the shape"),
        (
            lambda: af.Contact([af.Obstacle(BALL, placement=turned(0, shift=(1e30, 0, 0)))]),
            r"obstacles\[0\]\.placement",
        ),
    ],
)
def test_what_is_too_far_from_the_shape_is_named(contact, named):
    """It was called points that are not finite, or diverged."""
    samples = af.SurfaceSamples(np.eye(3).repeat(20, 0), np.eye(3).repeat(20, 0))
    with pytest.raises(af.InvalidInput, match=named):
        af.LiveDeformer(samples, [af.Cuboid(np.eye(4), np.eye(4))], QUICK, contact=contact())


def test_a_tiny_margin_is_a_margin():
    assert af.Obstacle(BALL, margin=1e-300).margin == 1e-300
