"""Several processes for work that is many alike."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, parent_process, resource_tracker
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Thread

from cam_rig.errors import Terminated


class _Worker(SpawnProcess):
    """A process that Ctrl-C does not reach, from its first instruction on.

    The terminal interrupts all processes of a command. A worker would print where it was, in the
    middle of its imports as likely as not; so the command alone is interrupted, and ends it.
    """

    def start(self) -> None:
        resource_tracker.ensure_running()  # it takes the signal off the mask when it starts
        with _interrupt_deferred():
            super().start()


@contextmanager
def _interrupt_deferred() -> Iterator[None]:
    """What is started here has SIGINT blocked, and is wholly started before an interrupt is raised.

    Blocking alone would leave that to the other threads of this process. SIGTERM waits too, and is
    not blocked: workers are ended by it. In the main thread only, as all handlers of signals.
    """
    received: list[int] = []
    handlers = {
        number: signal.signal(number, lambda number, _frame: received.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if received:
            signal.raise_signal(received[0])


class _Workers(SpawnContext):
    """Where a pool has such processes from."""

    Process = _Worker


def _end_with_parent() -> None:
    """End this worker when the command is gone: one that was killed could not end it itself."""
    parent = parent_process()
    assert parent is not None  # a worker has one

    def follow() -> None:
        wait([parent.sentinel])
        os._exit(1)

    Thread(target=follow, daemon=True).start()


@contextmanager
def _termination_raised() -> Iterator[None]:
    """SIGTERM ends what is done here as Ctrl-C does; by default nothing would be put away."""

    def end(_number: int, _frame: object) -> None:
        raise Terminated

    handler = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, handler)


@contextmanager
def workers(count: int | None = None) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes, as many as there are cores; work not begun is dropped at an error.

    Each computes on one core: the matrices are too small to share. An interrupt, or SIGTERM, ends
    them at once.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    with _termination_raised():
        yield from _pool(count)


def _pool(count: int | None) -> Iterator[ProcessPoolExecutor]:
    pool = ProcessPoolExecutor(
        count or os.cpu_count(), mp_context=_Workers(), initializer=_end_with_parent
    )
    try:
        with _interrupt_deferred():  # else one may find the pool's own thread half started
            pool.submit(os.getpid)
        yield pool
    except KeyboardInterrupt:
        for child in active_children():
            if isinstance(child, _Worker):
                child.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
