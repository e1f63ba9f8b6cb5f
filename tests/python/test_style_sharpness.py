# SPDX-License-Identifier: GPL-3.0-or-later
"""Sharpness, weight and reach that follow from a style's normals."""

import numpy as np
import pytest
from support.geometry import cases, meshes
from support.tolerances import GAUSS_WEIGHTS

import arapfields as af
from arapfields.cli.handles import turn_upright

LOWEST, HIGHEST = 5.0, 25.0
FACES = {"octahedron": 8, "dodecahedron": 12, "icosahedron": 20, "hexagonal prism": 8, "square pyramid": 5}


def overlap(preferred, sharpness):
    """exp(σ (cos θ/2 − 1)) midway between the closest two of different directions."""
    cosines = preferred @ preferred.T
    nearest = cosines[cosines < 0.99].max()
    return np.exp(sharpness * (np.sqrt((1 + nearest) / 2) - 1))


@pytest.mark.parametrize("name", FACES)
def test_neighbours_overlap_as_the_cubes_do(name):
    preferred = af.preferred_normals(name)
    sharpness = af.style_sharpness(preferred)
    assert LOWEST < sharpness < HIGHEST
    cube = af.preferred_normals("cube")
    assert overlap(preferred, sharpness) == pytest.approx(overlap(cube, 5.0), rel=1e-9)


@pytest.mark.parametrize("name", ["cube", "square prism", "tetrahedron", "triangular prism", "plane pair"])
def test_wide_angles_have_the_cubes(name):
    assert af.style_sharpness(af.preferred_normals(name)) == pytest.approx(LOWEST, rel=1e-12)


def test_a_curved_face_counts_as_one():
    """Facets of a cylinder, and of a cube's bevelled edge, are no neighbours."""
    for name in ("cylinder", "cone"):
        assert af.style_sharpness(af.preferred_normals(name)) == pytest.approx(LOWEST, rel=1e-12)
    cube = af.preferred_normals("cube")
    doubled = np.concatenate([cube, cube @ cases.turn([1, 2, 3], 4)[:3, :3].T])
    assert af.style_sharpness(np.concatenate([cube, cube])) == pytest.approx(LOWEST, rel=1e-12)
    assert LOWEST <= af.style_sharpness(doubled) < 1.15 * LOWEST
    ball = np.random.default_rng(0).normal(size=(3000, 3))
    assert af.style_sharpness(ball) == LOWEST
    assert af.style_sharpness([[0, 0, 2.0]]) == LOWEST


def test_it_depends_on_angles_alone():
    rng = np.random.default_rng(1)
    preferred = af.preferred_normals("dodecahedron")
    turn = cases.turn([3, -1, 2], 50)[:3, :3]
    same = (preferred @ turn.T * rng.uniform(0.1, 9, size=(12, 1)))[rng.permutation(12)]
    assert af.style_sharpness(same) == pytest.approx(af.style_sharpness(preferred), rel=1e-9)
    assert af.style_sharpness([[1, 0, 0], [np.cos(0.3), np.sin(0.3), 0]]) == HIGHEST
    for bad in ([[0, 0, 0]], np.zeros((0, 3)), [[np.nan, 0, 1]]):
        with pytest.raises(af.InvalidInput, match="normals"):
            af.style_sharpness(bad)


@pytest.mark.parametrize("name", af.style_names())
def test_no_sharpness_means_this_one(name):
    preferred = af.preferred_normals(name)
    normals = meshes.sphere(1.0)[0]
    automatic = af.gauss_preference(normals, preferred)
    assert np.array_equal(
        automatic, af.gauss_preference(normals, preferred, sharpness=af.style_sharpness(preferred))
    )
    assert np.abs(af.gauss_preference(preferred, preferred) - 1).max() < GAUSS_WEIGHTS


def ball(count=1000):
    return af.sample_mesh(*meshes.sphere(0.7), count=count, seed=0)


def test_a_weight_means_the_same_for_all_styles():
    """Of what there is to turn on a ball, every style turns a like share; at one sharpness they do not."""
    samples = ball(count=400)

    def closed(style, **options):
        how = af.StylizeOptions(field="radial", iterations=40, gauss_weight=0.6, **options)
        sharpness = options.get("sharpness", 0.0)
        preferred = af.preferred_normals(style)
        before = af.gauss_preference(samples.normals, preferred, sharpness=sharpness).mean()
        return (af.stylize(samples, style, how).report["preference"] - before) / (1 - before)

    solids = ["cube", "octahedron", "dodecahedron", "icosahedron", "hexagonal prism"]
    shares = [closed(style) for style in solids]
    assert min(shares) > 0.5 and np.ptp(shares) < 0.15
    assert np.ptp([closed(style, sharpness=5.0) for style in solids]) > 2 * np.ptp(shares)


def test_a_flat_pair_leaves_the_walls_and_the_thickness():
    samples = ball()
    field = af.stylize(samples, "plane pair", af.StylizeOptions(field="radial", iterations=100))
    moved, rest = field(samples.points), samples.points
    assert np.ptp(moved[:, 2]) > 0.3 * np.ptp(rest[:, 2])  # the caps that are cut end at half of it
    flat = af.stylize(samples, "plane pair", af.StylizeOptions(field="radial", iterations=100, sharpness=5.0))
    assert np.ptp(flat(rest)[:, 2]) < 0.5 * np.ptp(moved[:, 2])
    normals = np.linalg.solve(field.jacobian(rest).transpose(0, 2, 1), samples.normals[..., None])[..., 0]
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    caps = np.abs(samples.normals[:, 2]) > np.cos(np.radians(50))
    assert (np.abs(normals[caps, 2]) > np.cos(np.radians(10))).mean() > 0.8


@pytest.mark.parametrize("up", [[0, 0, 1], [0, 0, -2], [0, 3, 0], [0.3, -1, 0.2]])
def test_the_command_line_turns_styles_upright(up):
    turn = turn_upright(np.array(up, float))
    assert np.allclose(turn @ [0, 0, 1], np.array(up) / np.linalg.norm(up))
    assert np.allclose(turn.T @ turn, np.eye(3)) and np.linalg.det(turn) > 0
