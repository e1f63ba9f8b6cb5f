# SPDX-License-Identifier: GPL-3.0-or-later
"""extract_surface on the published networks against scikit-image on the dense grid."""

import numpy as np
import pytest
from meshes import check_closed
from network_oracle import Network
from tolerances import SAME_VERTICES

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
    V, F = af.extract_surface(sdf, 64)
    check_same_vertices(V, dense_surface(sdf, 64))
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
