# SPDX-License-Identifier: GPL-3.0-or-later
"""farm.map on workers of Dask: in order, failures apart, deaths of workers survived."""

import os
import signal

import numpy as np
import pytest
from support.geometry.meshes import sphere

import arapfields as af
from arapfields import farm

distributed = pytest.importorskip("distributed", reason="Dask is not installed: pip install distributed")


@pytest.fixture(scope="module")
def client():
    settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**settings) as cluster, distributed.Client(cluster) as client:
        yield client


def volume(scale):
    """Of a stretched sphere, computed on the worker."""
    if scale < 0:
        raise ValueError(f"scale {scale}")
    vertices, triangles = sphere(1.0, 2)
    samples = af.sample_mesh(scale * np.asarray(vertices), triangles, 500)
    return float(np.ptp(samples.points)), af.thread_count(), os.getpid()


class Deadly:
    """Ends its worker the first time that an item is met, or each time."""

    def __init__(self, folder, always):
        self.folder, self.always = folder, always

    def __call__(self, item):
        mark = self.folder / str(item)
        if item == 3 and (self.always or not mark.exists()):
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return item**2


@pytest.mark.slow
def test_outcomes_are_in_order_and_failures_stop_no_other(client):
    calls = []
    outcomes = farm.map(volume, [3.0, -1.0, 1.0, 2.0], client, on_done=calls.append)
    assert [outcome.item for outcome in outcomes] == [3.0, -1.0, 1.0, 2.0]
    assert [outcome.done for outcome in outcomes] == [True, False, True, True]
    assert isinstance(outcomes[1].error, ValueError) and "scale -1.0" in str(outcomes[1].error)
    here = [volume(scale)[0] for scale in (3.0, 1.0, 2.0)]
    values = [outcome.value for outcome in outcomes if outcome.done]
    assert [size for size, _, _ in values] == here  # to the last bit
    assert {threads for _, threads, _ in values} == {1} and os.getpid() not in {pid for *_, pid in values}
    assert sorted(map(id, calls)) == sorted(map(id, outcomes))
    assert farm.map(volume, [], client) == []


@pytest.mark.slow
def test_what_a_dying_worker_had_is_done_by_another(client, tmp_path):
    outcomes = farm.map(Deadly(tmp_path, always=False), range(20), client)
    assert [outcome.value for outcome in outcomes] == [i**2 for i in range(20)]
    assert (tmp_path / "3").exists()


@pytest.mark.slow
def test_what_ends_every_worker_is_given_up_and_named(client, tmp_path):
    outcomes = farm.map(Deadly(tmp_path, always=True), range(6), client)
    assert [outcome.done for outcome in outcomes] == [True, True, True, False, True, True]
    assert isinstance(outcomes[3].error, distributed.KilledWorker)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((abs, [1], None), "client: got NoneType"),
        ((abs, [1], "tcp://head:8786"), "client: got str"),
    ],
)
def test_what_is_no_client_is_named(arguments, text):
    with pytest.raises(af.InvalidInput, match=text):
        farm.map(*arguments)


@pytest.mark.slow
def test_a_function_that_cannot_travel_is_named(client):
    options = af.StylizeOptions()
    with pytest.raises(af.InvalidInput, match="function: cannot travel"):
        farm.map(lambda item: options, [1], client)


def test_without_dask_the_way_to_get_it_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(ImportError, match=r"pip install 'arapfields\[farm\]'"):
        farm.map(abs, [1], None)
