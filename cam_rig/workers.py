"""Several processes for work that is many alike: this machine's, or a Dask cluster."""

from __future__ import annotations

import logging
import os
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import active_children, parent_process, resource_tracker
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from threading import Thread
from typing import Any

from cam_rig.errors import ConfigError, RunError
from cam_rig.extras import libraries_named, require
from cam_rig.interrupts import STOPPING, interruptible

#: Of a command that was killed outright, Python's own process removes what it left, and says so.
UNTOLD = "ignore:resource_tracker:UserWarning"
#: What a worker begins with: one core for matrices, and memory (glibc's, in bytes) that is kept for
#: the next point, not given back and asked for anew.
WORKER_ENVIRONMENT = {
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"),
    "MALLOC_MMAP_THRESHOLD_": str(1 << 25),
    "MALLOC_TRIM_THRESHOLD_": str(1 << 26),
}


class _Worker(SpawnProcess):
    """A process that no signal to a command reaches: it would print where it was.

    The command alone is interrupted, and kills it.
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
    """Start Python's own process that removes what a command leaves, deaf to a hang-up too."""
    # It ignores the other signals, and inherits the mask for this one. Another that took its place
    # would know nothing of what there is to remove, and print tracebacks of it.
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
    """
    for name, value in WORKER_ENVIRONMENT.items():
        os.environ.setdefault(name, value)
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
        follower: Any = pool._executor_manager_thread
        sent = pool._result_queue._writer  # type: ignore[attr-defined]
        # First: Python 3.11 prints a traceback of one that is broken and has work that was dropped.
        pool.shutdown(wait=False, cancel_futures=True)
        for child in active_children():
            if isinstance(child, _Worker):
                child.kill()
        # Of a result that a worker was sending, the rest would be waited for as long as a process
        # could write it, this one too.
        sent.close()
        if follower is not None:  # no work was given before
            follower.join()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def broken_named(then: str = "") -> Iterator[None]:
    """Whatever an executor says when it breaks down, in one line."""
    try:
        yield
    except (BrokenExecutor, CancelledError) as error:
        name = type(error).__name__
        raise RunError(
            f"a worker or the scheduler is gone ({name}){then}; remedy: fewer --jobs where memory "
            "ran out, else the same again"
        ) from None


#: Longest wait for a scheduler, and for its first worker, s.
WAIT_S = 15.0


@dataclass(frozen=True)
class Workplace:
    """An executor and how many pieces of work it takes at a time."""

    executor: Executor
    count: int


@contextmanager
def workplace(jobs: int | None, dask: str | None) -> Iterator[Workplace]:
    """So many processes (None is one a core), or the cluster at an address."""
    if dask is None:
        with workers(jobs) as pool, broken_named():
            yield Workplace(pool, jobs or os.cpu_count() or 1)
        return
    check_workplace(jobs, dask)
    with _client(dask) as client:
        found = Workplace(client.get_executor(pure=False), _count(client, dask))
        with broken_named():
            yield found


def check_workplace(jobs: int | None, dask: str | None) -> None:
    """Refuse, before anything runs, a cluster that cannot be asked, and two places at once."""
    if dask is not None:
        if jobs is not None:
            raise ConfigError("--jobs and --dask: the cluster has its own; allowed: one of them")
        require("distributed")
        _where(dask)


def _where(dask: str) -> dict[str, str]:
    if "://" in dask:
        return {"address": dask}
    if not Path(dask).is_file():
        raise ConfigError(
            f"--dask: is {dask!r}; allowed: an address such as tcp://127.0.0.1:8786, or the file "
            "that `dask scheduler --scheduler-file` wrote"
        )
    return {"scheduler_file": dask}


@interruptible
def _client(dask: str) -> Any:  # Dask's functions are untyped
    with libraries_named():
        from distributed import Client
    connect: Any = Client
    for name in list(logging.root.manager.loggerDict):  # its errors are ours to tell
        if name.startswith("distributed"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        return connect(**_where(dask), timeout=WAIT_S, set_as_default=False)
    except (OSError, ValueError) as error:  # of no connection, and of what is no address
        raise RunError(f"--dask {dask}: no scheduler answers ({type(error).__name__})") from None


@interruptible
def _count(client: Any, dask: str) -> int:
    """How many pieces of work a cluster takes at a time."""
    try:
        client.wait_for_workers(1, timeout=WAIT_S)
    except TimeoutError:
        raise RunError(
            f"--dask {dask}: the scheduler has no workers; start some with: dask worker"
        ) from None
    return sum(client.nthreads().values())
