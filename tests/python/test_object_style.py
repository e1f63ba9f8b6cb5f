# SPDX-License-Identifier: GPL-3.0-or-later
"""Styles read off an object: the map of directions, its energy, and what it makes of shapes."""

import numpy as np
import pytest
import torch
from support.geometry import meshes
from support.oracles.energies import gradient_of, jacobians_of, jets_with_jacobians
from support.programs.cli import run
from support.tolerances import COMPOSED, FLOAT64_GRADIENT

import arapfields as af
from arapfields._native import testing
from arapfields.cli.files import read_mesh


def directions(count=2000, seed=0):
    rows = np.random.default_rng(seed).normal(size=(count, 3))
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def superquadric(power, count=40):
    """A sphere for 2, towards a rounded cube for more."""
    vertices, triangles = meshes.sphere(subdivisions=4)
    return vertices / (np.abs(vertices) ** power).sum(1, keepdims=True) ** (1 / power), triangles


@pytest.mark.parametrize("subdivisions", [1, 3])
def test_a_spheres_map_is_the_identity(subdivisions):
    vertices, triangles = meshes.sphere(subdivisions=subdivisions)
    if subdivisions == 1:  # its edges of 35 degrees and more are faces' edges: it is a solid of its own
        assert np.abs(af.ObjectStyle(vertices, triangles).normals(directions()) - directions()).max() > 0.1
        return
    for turn_inside_out in (False, True):
        style = af.ObjectStyle(3 * vertices + [5, 6, 7], triangles[:, ::-1] if turn_inside_out else triangles)
        assert np.abs(style.normals(directions()) - directions()).max() < 1e-12
        assert np.abs(style.centroid - [5, 6, 7]).max() < 1e-12


def test_a_boxs_map_is_the_face_in_a_direction_and_turns_with_it():
    style = af.ObjectStyle(*meshes.box())
    d = directions()
    nearest = np.where(np.abs(d) == np.abs(d).max(1, keepdims=True), np.sign(d), 0.0)
    away = np.sort(np.abs(d), axis=1)[:, 2] > np.sort(np.abs(d), axis=1)[:, 1] + 0.1
    assert np.abs(style.normals(d) - nearest)[away].max() < 1e-12
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    turned = style.turned(turn).normals(d @ turn.T, smoothing=0)
    assert np.abs(turned - style.normals(d, smoothing=0) @ turn.T).max() < 1e-9
    vertices, triangles = meshes.box((1.0, 2.0, 3.0))
    apart = vertices[triangles].reshape(-1, 3)  # a soup: corners that coincide are one
    soup = af.ObjectStyle(apart, np.arange(len(apart)).reshape(-1, 3))
    assert np.abs(soup.normals(d) - af.ObjectStyle(vertices, triangles).normals(d)).max() < 1e-12


def test_between_a_sphere_and_a_cube_lie_superquadrics():
    d = directions()
    cube = af.preferred_normals("cube")
    reached = [
        (af.ObjectStyle(*superquadric(power)).normals(d) @ cube.T).max(1).mean() for power in (2, 4, 8)
    ]
    assert reached[0] == pytest.approx((d @ cube.T).max(1).mean(), abs=1e-6)
    assert reached[0] + 0.05 < reached[1] < reached[2] - 0.02 < 1


def test_unmapped_directions_are_kept():
    """Through a torus's hole."""
    style = af.ObjectStyle(*meshes.torus())
    up = np.array([[0, 0, 1.0], [0, 0, -1.0]])
    assert np.abs(style.normals(up, smoothing=0) - up).max() < 1e-12
    outwards = np.array([[1.0, 0, 0], [0, -1.0, 0]])
    assert np.abs(style.normals(outwards) - outwards).max() < 0.02


def test_bad_style_objects_are_named():
    vertices, triangles = meshes.box()
    flat = vertices * [1, 1, 0]
    for mesh, message in (
        ((vertices, triangles[1:]), "open"),
        ((flat, triangles), "flat"),
        ((vertices, triangles[:0]), "triangles"),
        ((np.where(vertices > 0, np.nan, vertices), triangles), "vert"),
    ):
        with pytest.raises(af.InvalidInput, match=message):
            af.ObjectStyle(*mesh)
    style = af.ObjectStyle(vertices, triangles)
    for bad, message in (([[0, 0, 0]], "zero"), ([[np.nan, 0, 1]], "NaN")):
        with pytest.raises(af.InvalidInput, match=message):
            style.normals(bad)
    with pytest.raises(af.InvalidInput, match="smoothing"):
        style.normals([[0, 0, 1]], smoothing=-1.0)
    with pytest.raises(af.InvalidInput, match="orientation"):
        style.turned(np.eye(3) * 2)


def test_value_and_cotangent_equal_autograd_and_differences():
    rng = np.random.default_rng(1)
    jacobians = rng.normal(size=(400, 3, 3))
    jacobians = jacobians[np.abs(np.linalg.det(jacobians)) > 0.1][:101]
    jets = jets_with_jacobians(jacobians, rng, order=4)
    count = len(jacobians)
    normals, targets, effect = directions(count, 2), directions(count, 3), rng.uniform(size=count)
    value, cotangents = testing.target_energy(jets, normals, targets, 0.7, effect)

    def loss(leaf):
        moved = torch.linalg.solve(jacobians_of(leaf).mT, torch.tensor(normals))
        moved = moved / moved.norm(dim=1, keepdim=True)
        return (((moved - torch.tensor(targets)) ** 2).sum(1) * torch.tensor(effect)).mean()

    expected, gradient = gradient_of(loss, jets)
    assert value == pytest.approx(expected, rel=FLOAT64_GRADIENT)
    assert np.abs(cotangents - 0.7 * gradient).max() < FLOAT64_GRADIENT * np.abs(gradient).max()
    composed = testing.target_energy(jets, normals, targets, 0.7, effect, composed=True)
    assert composed[0] == pytest.approx(value, rel=COMPOSED)
    assert np.abs(composed[1] - cotangents).max() < COMPOSED * np.abs(cotangents).max()
    direction, step = rng.normal(size=jets.shape), 1e-6
    ends = [
        testing.target_energy(jets + sign * step * direction, normals, targets, 1.0, effect)[0]
        for sign in (1, -1)
    ]
    assert (ends[0] - ends[1]) / (2 * step) == pytest.approx((cotangents / 0.7 * direction).sum(), rel=1e-7)


SMALL = {
    "radial": {"iterations": 25},
    "neural": {"iterations": 60, "width": 32, "layers": 2, "batch": 200},
    "invertible": {"iterations": 60, "width": 32, "layers": 2, "batch": 200},
}


@pytest.mark.parametrize("field", SMALL)
def test_a_sphere_changes_nothing_and_a_cube_makes_cubic(field):
    samples = af.sample_mesh(*meshes.torus(), 1500, seed=0)
    options = af.StylizeOptions(field=field, **SMALL[field])
    still = af.stylize(samples, af.ObjectStyle(*meshes.sphere()), options)
    assert np.abs(still(samples.points) - samples.points).max() < 1e-6
    cube = af.ObjectStyle(*meshes.box())
    styled = af.stylize(samples, cube, options)
    before = (samples.normals * cube.normals(samples.normals)).sum(1).mean()
    assert styled.report.preference > before + 0.4 * (1 - before)
    lowest = samples.points[[samples.points[:, 2].argmin()]]
    assert np.abs((styled(lowest) - lowest)[:, 2]).max() < 1e-6


def test_a_live_style_of_an_object_turns_with_its_orientation():
    samples = af.sample_mesh(*meshes.sphere(), 1500, seed=0)
    cube = af.ObjectStyle(*meshes.box())
    live = af.LiveDeformer(samples, (), af.LiveOptions(samples=1000, fine_centers=120, interior=False))
    angle = np.radians(45)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    reach = []
    for style in (cube, cube.turned(turn)):
        live.set_style(style)
        points = live.solve(iterations=40)(samples.points)
        points -= points.mean(0)
        reach.append(np.abs(points @ turn[:, 0]).max() / np.abs(points[:, 0]).max())
    assert reach[0] > 1.1 and reach[1] < 1 / 1.1
    live.set_style(af.ObjectStyle(*meshes.sphere()))
    assert live.solve(iterations=60).report.preference is None


def test_the_command_line_takes_an_object(tmp_path, capsys):
    def write(name, vertices, triangles):
        rows = [f"v {x} {y} {z}" for x, y, z in vertices]
        rows += ["f " + " ".join(str(i + 1) for i in face) for face in triangles]
        (tmp_path / name).write_text("\n".join(rows) + "\n")
        return tmp_path / name

    shape = write("ball.obj", *meshes.sphere())
    cube, open_box = write("cube.obj", *meshes.box()), write("open.obj", meshes.box()[0], meshes.box()[1][1:])
    small = ["--iterations", "20", "--samples", "1000", "--quiet"]
    command = ["stylize", shape, "-o", tmp_path / "out.obj"]
    assert run(*command, "--style-object", cube, "--style-turn", "0,0,1", "45", *small) == 0
    points = np.array(
        [row.split()[1:4] for row in (tmp_path / "out.obj").read_text().splitlines() if row.startswith("v ")],
        float,
    )
    points -= points.mean(0)
    assert np.abs(points[:, 0]).max() > 1.1 * np.abs(points @ [0.5**0.5, 0.5**0.5, 0]).max()
    assert run(*command, "--style-object", open_box, *small) == 2
    assert "open.obj" in (errors := capsys.readouterr().err) and "open" in errors


@pytest.mark.slow
def test_a_cube_as_an_object_looks_like_the_preset(data_dir):
    """The mean preference of the deformed normals, which says how cubic a shape is."""
    samples = af.sample_mesh(*read_mesh(data_dir / "meshes" / "bunny.off"), 8000, seed=1)
    cube = af.preferred_normals("cube")
    for strength in (0.7, 1.0):
        reached = []
        for style in ("cube", af.ObjectStyle(*meshes.box())):
            field = af.stylize(samples, style, af.StylizeOptions(strength=strength), up=(0, 1, 0))
            moved = np.linalg.solve(
                np.swapaxes(field.jacobian(samples.points), 1, 2), samples.normals[..., None]
            )[..., 0]
            moved /= np.linalg.norm(moved, axis=1, keepdims=True)
            reached.append(af.gauss_preference(moved, cube).mean())
        assert abs(reached[0] - reached[1]) < 0.02
