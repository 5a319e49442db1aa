"""A campaign run: batches of points to an executor, their rows to the dataset as they come."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

from cam_rig.errors import RunError
from cam_rig.studies.campaign.dataset import CampaignDataset
from cam_rig.studies.campaign.point import BatchRows, measure_batch

P = ParamSpec("P")
T = TypeVar("T")
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
    dataset: CampaignDataset,
    executor: Executor,
    workers: int,
    done: Callable[[int], None] = lambda points: None,
) -> None:
    """Make every point that the dataset has not; the dataset must be open.

    A batch is sized by the cost of those before it. How points fall into batches, and who makes
    them in which order, changes no row.

    Parameters
    ----------
    executor : of processes, or Dask's: ``client.get_executor()``
    workers : how many batches it takes at a time
    done : told how many points were written

    Raises
    ------
    OutputError : a batch cannot be written
    RunError : the executor broke down: a process was killed, or the scheduler is gone
    """
    campaign = dataset.campaign
    sizes = BatchSizes(campaign.total, workers)
    todo = _batches(dataset.missing(), sizes)
    flying: set[Future[BatchRows]] = set()
    try:
        with broken_named("; what is finished stays"):
            while True:
                while len(flying) < sizes.in_flight and (batch := next(todo, None)) is not None:
                    flying.add(executor.submit(measure_batch, campaign, *batch))
                if not flying:
                    return
                finished, flying = wait(flying, return_when=FIRST_COMPLETED)
                for future in finished:
                    rows = future.result()
                    dataset.write(rows)
                    sizes.take(rows)
                    done(len(rows.reasons))
    finally:
        for future in flying:
            future.cancel()


@contextmanager
def broken_named(then: str = "") -> Iterator[None]:
    """Whatever an executor says when it breaks down, in one line.

    Raises
    ------
    RunError : it broke down
    """
    try:
        yield
    except (BrokenExecutor, CancelledError) as error:
        name = type(error).__name__
        raise RunError(
            f"a worker or the scheduler is gone ({name}){then}; remedy: fewer --jobs where memory "
            "ran out, else the same again"
        ) from None


class InThisProcess(Executor):
    """Does each piece of work where it is submitted, before it goes on."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """The work, done; an error is raised here."""
        future: Future[T] = Future()
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

    def take(self, rows: BatchRows) -> None:
        """Learn from a batch's cost."""
        count = len(rows.reasons)
        wanted = int(self._seconds * count / max(rows.seconds, 1e-9))
        self.next = max(1, min(max(wanted, self._least), GROWTH * count, self._most))
        self.in_flight = IN_FLIGHT * self._workers


def _batches(gaps: list[tuple[int, int]], sizes: BatchSizes) -> Iterator[tuple[int, int]]:
    """The gaps in pieces, each as long as a batch is to be when it is asked for."""
    for first, last in gaps:
        at = first
        while at < last:
            end = min(last, at + sizes.next)
            yield at, end
            at = end
