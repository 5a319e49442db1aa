"""Batches of points sent to an executor, and written to a dataset as they are computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from typing import Any

from cam_rig.datasets.point_files import Batch, PointFiles
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.workers import broken_named

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


def compute_missing(
    dataset: PointFiles,
    compute: Callable[[Any, int, int], Batch],
    executor: Executor,
    workers: int,
    progress: Progress = NULL_PROGRESS,
) -> None:
    """Compute the points that an open dataset lacks, and write them.

    `compute` takes the study and the first and last point of a batch. The size of a batch follows
    from the cost of those before it, and the executor has as many batches at a time as it has
    `workers`. The rows do not depend on the batches, on their order or on the executor.
    """
    campaign = dataset.campaign
    sizes = BatchSizes(campaign.total, workers)
    todo = _batches(dataset.missing(), sizes)
    flying: set[Future[Batch]] = set()
    try:
        with broken_named("; what is finished stays"):
            while True:
                while len(flying) < sizes.in_flight and (batch := next(todo, None)) is not None:
                    flying.add(executor.submit(compute, campaign, *batch))
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
