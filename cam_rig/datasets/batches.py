"""Computation of the points of a dataset in batches, by an executor.

A point is one row of the dataset. A batch is a range of consecutive points that one task computes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from typing import Any

from cam_rig.datasets.point_files import Batch, PointFiles
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.workers import friendly_executor_errors

#: Processor time (s) that a batch of points should take.
BATCH_S = 1.0
#: Processor time (s) per worker that a batch of points should take, used if the product with the
#: number of workers is more than `BATCH_S`. It is twice the time that scheduler and writer need for
#: a batch, so that workers never wait for them.
BATCH_PER_WORKER_S = 0.01
#: Approximate upper limit of the number of batches of points, and so of files of a dataset.
MAX_BATCHES = 20_000
#: Largest number of batches that are sent before the cost of the first is measured. Each of these
#: batches has one point.
MAX_PILOTS = 64
#: Largest number of points of a dataset that are computed as one batch.
MAX_POINTS = 1 << 16
#: Largest ratio of the number of points of a batch to that of the last measured batch.
MAX_GROWTH = 4
#: Number of batches in flight per worker: one is being computed, the others are queued.
IN_FLIGHT_PER_WORKER = 3


def compute_missing(
    dataset: PointFiles,
    task: Callable[[Any, int, int], Callable[[], Batch]],
    executor: Executor,
    workers: int,
    progress: Progress = NULL_PROGRESS,
) -> None:
    """Compute the missing points of an open dataset, and write them.

    The size of a batch follows from the cost of the batches before it. The rows do not depend on
    the batches, on their order or on the executor.

    Parameters
    ----------
    dataset : PointFiles
        Dataset within its context `open`.
    task : callable
        Function of the study, the first point and the end (exclusive) of a batch. It returns the
        task for the executor, which computes the rows of the batch.
    executor : Executor
        Executor that computes the batches.
    workers : int
        Number of batches that the executor computes at a time.
    progress : Progress, optional
        Receives the number of written points (default: the progress is not reported).

    Raises
    ------
    RunError
        If a worker or the scheduler dies. Written batches remain.
    """
    campaign = dataset.campaign
    sizes = BatchSizes(campaign.total, workers)
    batches = _batches(dataset.missing(), sizes)
    in_flight: set[Future[Batch]] = set()
    try:
        with friendly_executor_errors("; finished batches are kept"):
            while True:
                while len(in_flight) < sizes.in_flight and (batch := next(batches, None)):
                    in_flight.add(executor.submit(task(campaign, *batch)))
                if not in_flight:
                    return
                finished, in_flight = wait(in_flight, return_when=FIRST_COMPLETED)
                for future in finished:
                    rows = future.result()
                    dataset.write(rows)
                    sizes.take(rows)
                    progress.advance(rows.last - rows.first)
    finally:
        for future in in_flight:
            future.cancel()


class SerialExecutor(Executor):
    """Executor that runs each task in this process when it is submitted."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run a task and return its completed future. An exception is raised at once."""
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


class BatchSizes:
    """Sizes of the batches of a dataset of `total` points.

    The first batches have one point. The next batches take `BATCH_S`, or `BATCH_PER_WORKER_S` times
    the number of workers if that is longer. They are larger if there would be more than
    `MAX_BATCHES`.

    Attributes
    ----------
    next : int
        Number of points of the next batch.
    in_flight : int
        Number of batches to send before the first of them returns.
    """

    def __init__(self, total: int, workers: int) -> None:
        self._max_size = max(1, min(MAX_POINTS, total // (2 * workers)))
        self._min_size = min(self._max_size, -(-total // MAX_BATCHES))
        self._seconds, self._workers = max(BATCH_S, BATCH_PER_WORKER_S * workers), workers
        self.next, self.in_flight = 1, min(MAX_PILOTS, IN_FLIGHT_PER_WORKER * workers)

    def take(self, rows: Batch) -> None:
        """Set the size of the next batch from the measured time of a computed batch.

        The number of batches in flight is set to `IN_FLIGHT_PER_WORKER` per worker.
        """
        count = rows.last - rows.first
        size = int(self._seconds * count / max(rows.seconds, 1e-9))
        self.next = max(1, min(max(size, self._min_size), MAX_GROWTH * count, self._max_size))
        self.in_flight = IN_FLIGHT_PER_WORKER * self._workers


def _batches(gaps: list[tuple[int, int]], sizes: BatchSizes) -> Iterator[tuple[int, int]]:
    """Yield the first point and the end (exclusive) of each batch of missing points.

    `gaps` are the ranges of missing points. The size of a batch is the value of `sizes.next` at the
    time at which it is requested.
    """
    for start, last in gaps:
        first = start
        while first < last:
            end = min(last, first + sizes.next)
            yield first, end
            first = end
