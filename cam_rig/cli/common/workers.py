"""Several processes for work that is many alike."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, parent_process, resource_tracker
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Thread

from cam_rig.errors import RunError
from cam_rig.interrupts import STOPPING

#: Of a command that was killed outright, Python's own process removes what it left, and says so.
UNTOLD = "ignore:resource_tracker:UserWarning"


class _Worker(SpawnProcess):
    """A process that no signal to a command reaches, from its first instruction on.

    A terminal signals all processes of a command. A worker would print where it was, in the
    middle of its imports as likely as not; so the command alone is interrupted, and kills it.
    """

    def start(self) -> None:
        _start_tracker()  # it takes signals off the mask when it starts
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, STOPPING)
        try:
            super().start()
        except OSError as error:
            raise _none_left(error) from None
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


class _Workers(SpawnContext):
    """Where a pool has such processes from."""

    Process = _Worker


def _none_left(error: OSError) -> RunError:
    return RunError(
        f"no worker can be started ({error.strerror or error}); allowed: as many processes as "
        "/dev/shm has room for and the user may have (df /dev/shm, ulimit -u), so make room, or "
        "fewer --jobs"
    )


def _start_tracker() -> None:
    """Start Python's own process that removes what a command leaves, deaf to a hang-up too.

    It ignores the other signals that end a command, and inherits the mask for this one. Another
    that took its place would know nothing of what there is to remove, and print tracebacks of it.
    """
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        resource_tracker.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _end_with_parent() -> None:
    """End this worker when the command is gone: one that was killed could not end it itself."""
    parent = parent_process()
    assert parent is not None  # a worker has one

    def follow() -> None:
        wait([parent.sentinel])
        os._exit(1)

    Thread(target=follow, daemon=True).start()


@contextmanager
def workers(count: int | None = None) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes, as many as there are cores; work not begun is dropped at an error.

    Each computes on one core: the matrices are too small to share. An interrupt ends them at once.

    Raises
    ------
    RunError : the system has no process, or no shared memory, left for them
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    if UNTOLD not in sys.warnoptions:
        sys.warnoptions.append(UNTOLD)
    try:
        _start_tracker()
        pool = ProcessPoolExecutor(
            count or os.cpu_count(), mp_context=_Workers(), initializer=_end_with_parent
        )
    except OSError as error:
        raise _none_left(error) from None
    try:
        yield pool
    except KeyboardInterrupt:
        for child in active_children():
            if isinstance(child, _Worker):
                child.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
