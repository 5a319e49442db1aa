"""A campaign run: batches of points to an executor, their rows to the dataset as they come."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from pathlib import Path
from typing import Any

from cam_rig.arguments import checked
from cam_rig.campaigns.campaign import Batch, Campaign, campaign_from, measure_batch, open_campaign
from cam_rig.campaigns.dataset import CampaignDataset, PointFiles
from cam_rig.campaigns.results import CampaignResult
from cam_rig.extras import require
from cam_rig.schema.load import Library, config_root, named_path
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.workers import broken_named


def opened(study: str | Path | Mapping[str, Any]) -> Campaign:
    """A study by its name in ``config/campaigns``, a path, or what such a file holds."""
    if isinstance(study, Mapping):
        return campaign_from(study, Library((config_root(),)))
    return open_campaign(named_path("campaigns", study))


@checked
def campaign(
    study: str | Path | Mapping[str, Any],
    out: str | Path,
    *,
    points: int | None = None,
    seed: int | None = None,
    resume: bool = False,
    executor: Executor | None = None,
    workers: int = 1,
) -> CampaignResult:
    """Measure many rigs that differ in some numbers; rows go into a folder of Parquet files.

    The command is ``cam-rig campaign``.

    Parameters
    ----------
    study : a name in ``config/campaigns``, a path, or what such a file holds
    out : folder of the dataset
    points, seed : in place of the study's
    resume : go on with the points that the folder has not; a file that is not as it was written
        is named in a warning, and its points are made again
    executor : where points are measured: a `ProcessPoolExecutor`, Dask's
        ``client.get_executor()``; None is this process. Rows are the same
    workers : batches the executor takes at a time

    Raises
    ------
    ConfigError : something wrong in the study, or a folder of other rows
    OutputError : the folder cannot be written
    RunError : the executor broke down; what is finished stays
    MissingLibraryError : pyarrow is not installed

    Examples
    --------
    >>> import tempfile, cam_rig
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     found = cam_rig.campaign("tolerance_poly345", folder, points=8)
    ...     found.to_pandas().jump_speed_rpm.round(1).tolist()[:3]
    [173.8, 416.3, 274.9]
    """
    require("pyarrow")
    dataset = CampaignDataset(Path(out), opened(study).planned(points, seed))
    with dataset.opened(resume) as damaged:
        if damaged:
            warnings.warn(damaged, stacklevel=2)
        run_campaign(dataset, executor or InThisProcess(), max(1, workers))
    return CampaignResult(dataset)


#: Processor time a batch should take, s, and more for each worker: twice what a batch costs the
#: scheduler and the one writer, so that they are never what all others wait for.
BATCH_S, EACH_WORKER_S = 1.0, 0.01
#: Batches of a campaign, and so its files, at most or little more.
MAX_BATCHES = 20_000
#: Batches of one point that are sent before a cost is known, at most.
PILOTS = 64
#: A batch has at most so many points, and so many times those of the one measured before it.
MAX_BATCH, GROWTH = 1 << 16, 4
#: Batches in flight for each worker: one at work and others waiting.
IN_FLIGHT = 3


def run_campaign(
    dataset: PointFiles,
    executor: Executor,
    workers: int,
    progress: Progress = NULL_PROGRESS,
    measure: Callable[[Any, int, int], Batch] = measure_batch,
) -> None:
    """Make every point that the dataset has not; the dataset must be open.

    A batch is sized by the cost of those before it; the executor takes as many at a time as it has
    ``workers``. How points fall into batches, and who makes them in which order, changes no row.
    """
    campaign = dataset.campaign
    sizes = BatchSizes(campaign.total, workers)
    todo = _batches(dataset.missing(), sizes)
    flying: set[Future[Batch]] = set()
    try:
        with broken_named("; what is finished stays"):
            while True:
                while len(flying) < sizes.in_flight and (batch := next(todo, None)) is not None:
                    flying.add(executor.submit(measure, campaign, *batch))
                if not flying:
                    return
                finished, flying = wait(flying, return_when=FIRST_COMPLETED)
                for future in finished:
                    rows = future.result()
                    dataset.write(rows)
                    sizes.take(rows)
                    progress.advance(rows.last - rows.first)
    finally:
        for future in flying:
            future.cancel()


class InThisProcess(Executor):
    """Does each piece of work where it is submitted, before it goes on."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """The work, done; an error is raised here."""
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


class BatchSizes:
    """How many points the next batch has, and how many batches are sent ahead.

    From one point on as many as last `BATCH_S`, or `EACH_WORKER_S` times the workers; more where
    there would be more batches than `MAX_BATCHES`.
    """

    def __init__(self, total: int, workers: int) -> None:
        self._most = max(1, min(MAX_BATCH, total // (2 * workers)))
        self._least = min(self._most, -(-total // MAX_BATCHES))
        self._seconds, self._workers = max(BATCH_S, EACH_WORKER_S * workers), workers
        self.next, self.in_flight = 1, min(PILOTS, IN_FLIGHT * workers)

    def take(self, rows: Batch) -> None:
        """Learn from a batch's cost."""
        count = rows.last - rows.first
        wanted = int(self._seconds * count / max(rows.seconds, 1e-9))
        self.next = max(1, min(max(wanted, self._least), GROWTH * count, self._most))
        self.in_flight = IN_FLIGHT * self._workers


def _batches(gaps: list[tuple[int, int]], sizes: BatchSizes) -> Iterator[tuple[int, int]]:
    """The gaps in pieces, each as long as a batch is to be when it is asked for."""
    for at, last in gaps:
        first = at
        while first < last:
            end = min(last, first + sizes.next)
            yield first, end
            first = end
