# SPDX-License-Identifier: GPL-3.0-or-later
"""extract_surface on the published networks against scikit-image on the dense grid."""

import numpy as np
import pytest
from support.geometry.meshes import check_closed
from support.oracles.network import Network
from support.tolerances import SAME_VERTICES

import arapfields as af

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
