"""Worker processes for many similar tasks: on this machine or in a Dask cluster."""

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
from cam_rig.extras import friendly_import_errors, require
from cam_rig.interrupts import STOPPING, interruptible

#: Warning filter for Python's resource tracker, which would print a warning when it cleans up after
#: a killed command.
TRACKER_FILTER = "ignore:resource_tracker:UserWarning"
#: Environment variables of a worker. Matrix libraries use one core. The limits of glibc (bytes)
#: make it keep freed memory for the next point instead of returning it to the system.
WORKER_ENVIRONMENT = {
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"),
    "MALLOC_MMAP_THRESHOLD_": str(1 << 25),
    "MALLOC_TRIM_THRESHOLD_": str(1 << 26),
}
#: Longest time (s, wall clock) to wait for a Dask scheduler, and for its first worker.
WAIT_S = 15.0


class _Worker(SpawnProcess):
    """Process that ignores the signals that end a command.

    A signal of the terminal reaches all processes, and a worker would print a traceback. Only the
    command is interrupted, and kills its workers.
    """

    def start(self) -> None:
        _start_tracker()  # it unblocks signals when it starts
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, STOPPING)
        try:
            super().start()
        except OSError as error:
            raise _start_error(error) from None
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


class _Workers(SpawnContext):
    """Multiprocessing context whose processes are `_Worker`."""

    Process = _Worker


def _start_error(error: OSError) -> RunError:
    """Return the error for a worker that cannot be started."""
    return RunError(
        f"no worker can be started ({error.strerror or error}); allowed: as many processes as "
        "/dev/shm has room for and the user may have (df /dev/shm, ulimit -u), so make room, or "
        "fewer --jobs"
    )


def _start_tracker() -> None:
    """Start Python's resource tracker so that it ignores SIGHUP as well.

    It ignores the other signals itself, and inherits the mask for SIGHUP. If it were killed, the
    tracker that replaces it would not know the resources, and print a traceback for each.
    """
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        resource_tracker.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _end_with_parent() -> None:
    """Let this worker end when its command has ended.

    A killed command cannot end its workers.
    """
    parent = parent_process()
    assert parent is not None  # a worker has a parent

    def follow() -> None:
        wait([parent.sentinel])
        os._exit(1)

    Thread(target=follow, daemon=True).start()


@contextmanager
def workers(count: int | None = None) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of worker processes.

    Each worker computes on one core, because the matrices are too small to share. After an error,
    tasks that have not started are dropped. An interrupt kills the workers at once.

    Parameters
    ----------
    count : int or None
        Number of processes (default: the number of cores).

    Raises
    ------
    RunError
        If a process cannot be started.
    """
    for name, value in WORKER_ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    if TRACKER_FILTER not in sys.warnoptions:
        sys.warnoptions.append(TRACKER_FILTER)
    try:
        _start_tracker()
        pool = ProcessPoolExecutor(
            count or os.cpu_count(), mp_context=_Workers(), initializer=_end_with_parent
        )
    except OSError as error:
        raise _start_error(error) from None
    try:
        yield pool
    except KeyboardInterrupt:
        manager: Any = pool._executor_manager_thread
        results = pool._result_queue._writer  # type: ignore[attr-defined]
        # First, because Python 3.11 prints a traceback of a broken pool with dropped tasks.
        pool.shutdown(wait=False, cancel_futures=True)
        for child in active_children():
            if isinstance(child, _Worker):
                child.kill()
        # The manager waits for the rest of a result that a killed worker was sending, as long as
        # any process could write it. This process could, too.
        results.close()
        if manager is not None:  # None before the first task
            manager.join()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def friendly_executor_errors(then: str = "") -> Iterator[None]:
    """Convert the errors of a broken executor to a RunError.

    `then` is inserted into the message, after the cause.
    """
    try:
        yield
    except (BrokenExecutor, CancelledError) as error:
        name = type(error).__name__
        raise RunError(
            f"a worker or the scheduler is gone ({name}){then}; remedy: fewer --jobs where memory "
            "ran out, else the same again"
        ) from None


@dataclass(frozen=True)
class ExecutorPool:
    """Executor of tasks, with its capacity.

    `count` is the number of tasks that it computes at a time.
    """

    executor: Executor
    count: int


@contextmanager
def executor_pool(jobs: int | None, dask: str | None) -> Iterator[ExecutorPool]:
    """Yield an executor: worker processes of this machine, or a Dask cluster.

    Parameters
    ----------
    jobs : int or None
        Number of processes (default: the number of cores).
    dask : str or None
        Address of a scheduler, or path of its file. None selects this machine.

    Raises
    ------
    ConfigError
        If both parameters are given, or `dask` is neither an address nor a file.
    RunError
        If no scheduler answers, the cluster lacks workers, or a worker dies.
    """
    if dask is None:
        with workers(jobs) as pool, friendly_executor_errors():
            yield ExecutorPool(pool, jobs or os.cpu_count() or 1)
        return
    check_executor_options(jobs, dask)
    with _client(dask) as client:
        cluster = ExecutorPool(client.get_executor(pure=False), _thread_count(client, dask))
        with friendly_executor_errors():
            yield cluster


def check_executor_options(jobs: int | None, dask: str | None) -> None:
    """Raise ConfigError for both `jobs` and `dask`, or a wrong `dask`.

    Commands call this before they compute.
    """
    if dask is not None:
        if jobs is not None:
            raise ConfigError(
                "--jobs cannot be combined with --dask: the cluster sets the number of workers"
            )
        require("distributed")
        _client_arguments(dask)


def _client_arguments(dask: str) -> dict[str, str]:
    """Return the arguments of Dask's client for an address or a scheduler file."""
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
    """Return a client of a Dask scheduler."""
    with friendly_import_errors():
        from distributed import Client
    connect: Any = Client
    for name in list(logging.root.manager.loggerDict):  # errors are raised here instead
        if name.startswith("distributed"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        return connect(**_client_arguments(dask), timeout=WAIT_S, set_as_default=False)
    except (OSError, ValueError) as error:  # no connection, or an invalid address
        raise RunError(f"--dask {dask}: no scheduler answers ({type(error).__name__})") from None


@interruptible
def _thread_count(client: Any, dask: str) -> int:
    """Return the number of tasks that a cluster computes at a time."""
    try:
        client.wait_for_workers(1, timeout=WAIT_S)
    except TimeoutError:
        raise RunError(
            f"--dask {dask}: the scheduler has no workers; start some with: dask worker"
        ) from None
    return sum(client.nthreads().values())
