"""The same rows whatever runs them: this process, two, a Dask cluster that loses a worker."""

import os
import signal
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from distributed import Client, LocalCluster

from cam_rig.campaigns.campaign import measure_batch
from cam_rig.campaigns.dataset import CampaignDataset
from cam_rig.campaigns.run import BATCH_S, BatchSizes, InThisProcess, run_campaign
from cam_rig.errors import RunError
from cam_rig.show.result import Progress

PARTS = {
    "vary": {
        "rig.follower.preload": {"uniform": 10, "unit": "%"},
        "rig.follower.mass": {"normal": 60, "unit": "%"},
    },
    "correlated": [{"inputs": ["rig.follower.preload", "rig.follower.mass"], "coefficient": 0.5}],
    "plan": {"kind": "sobol", "points": 16, "seed": 2},
    "measures": ["jump_speed", "jump_speed_rigid"],
}


class Killing(Progress):
    """Kills a process as soon as the first points are written."""

    def __init__(self, process):
        self.process, self.killed = process, None

    def advance(self, steps=1):
        if self.killed is None:
            self.killed = self.process()
            os.kill(self.killed, signal.SIGKILL)


def columns(dataset):
    return {name: dataset.column(name) for name in dataset.schema.names if name not in ("version",)}


def same(one, other):
    for name, column in one.items():
        left, right = column.tolist(), other[name].tolist()
        assert [repr(value) for value in left] == [repr(value) for value in right], name


@pytest.fixture(scope="module")
def alone(study, tmp_path_factory):
    """The rows that this process makes, one batch after another."""
    dataset = CampaignDataset(tmp_path_factory.mktemp("alone"), study(**PARTS))
    with dataset.opened(False):
        run_campaign(dataset, InThisProcess(), 1)
    return dataset


def test_some_points_fail_and_all_are_there(alone):
    """A mass that is normal with 60 % is sometimes below zero: a row with a reason."""
    found = columns(alone)
    assert found["point"].tolist() == list(range(16))
    failed = found["status"] == "failed"
    assert 0 < failed.sum() < 10
    assert np.array_equal(failed, np.isnan(found["jump_speed_rpm"]))


def test_a_point_is_the_same_after_any_other(alone):
    """Backwards, in batches of one."""
    campaign = alone.campaign
    expected = alone.column("jump_speed_rpm")
    for point in (15, 11, 5):
        rows = measure_batch(campaign, point, point + 1)
        assert repr(rows.measures[0, 0]) == repr(np.float64(expected[point]))


@pytest.mark.long
def test_a_cluster_that_loses_a_worker_makes_the_same_rows(alone, tmp_path):
    """Its nanny starts another, and the scheduler gives the work again: no row twice."""
    dataset = CampaignDataset(tmp_path, alone.campaign)
    with (
        LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0"
        ) as cluster,
        Client(cluster) as client,
        dataset.opened(False),
    ):
        killing = Killing(lambda: next(iter(client.run(os.getpid).values())))
        run_campaign(dataset, client.get_executor(pure=False), 2, killing)
    assert killing.killed
    assert sum(last - first for first, last, _ in dataset.batches()) == 16
    same(columns(alone), columns(dataset))


def test_a_killed_process_ends_the_run_in_a_line_and_resuming_makes_the_rest(alone, tmp_path):
    """What was finished stays; the dataset is then the same."""
    dataset = CampaignDataset(tmp_path, alone.campaign)
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        killing = Killing(lambda: next(iter(pool._processes)))
        with dataset.opened(False), pytest.raises(RunError, match="what is finished stays"):
            run_campaign(dataset, pool, 1, killing)
    assert dataset.missing() != []
    with dataset.opened(True):
        run_campaign(dataset, InThisProcess(), 1)
    assert dataset.missing() == []
    same(columns(alone), columns(dataset))


def test_a_batch_lasts_as_long_as_it_should(alone):
    """From one point on, four times as many at most; a slow point is alone in its batch."""
    rows = measure_batch(alone.campaign, 0, 3)

    def after(seconds, count, total=10**4, workers=2):
        sizes = BatchSizes(total, workers)
        object.__setattr__(rows, "seconds", seconds)
        object.__setattr__(rows, "reasons", ("",) * count)
        sizes.take(rows)
        return sizes.next

    assert (BatchSizes(10**6, 2).next, BatchSizes(10**6, 1000).in_flight) == (1, 64)
    assert after(BATCH_S * 100 / 50, 100) == 50
    assert after(1e-6, 100) == 400
    assert after(10.0 * BATCH_S, 1) == 1
    assert after(10.0 * BATCH_S, 1, total=10**8) == 4
    assert after(BATCH_S * 100 / 50, 100, total=10**7, workers=1000) == 400
