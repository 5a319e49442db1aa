"""Where work that is many alike is done: this machine's processes, or a Dask cluster."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cam_rig.cli.common.workers import workers
from cam_rig.errors import ConfigError, RunError
from cam_rig.extras import libraries_named, require
from cam_rig.interrupts import interruptible
from cam_rig.studies.campaign.run import broken_named

#: Longest wait for a scheduler, and for its first worker, s.
WAIT_S = 15.0


@dataclass(frozen=True)
class Workplace:
    """An executor and how many pieces of work it takes at a time."""

    executor: Executor
    count: int


@contextmanager
def workplace(jobs: int | None, dask: str | None) -> Iterator[Workplace]:
    """So many processes (None is one a core), or the cluster at an address.

    Raises
    ------
    ConfigError : both are asked for, or no address
    RunError : no scheduler answers, it has no workers, or a worker is gone in the middle
    MissingLibraryError : Dask is not installed
    """
    if dask is None:
        with workers(jobs) as pool, broken_named():
            yield Workplace(pool, jobs or os.cpu_count() or 1)
        return
    if jobs is not None:
        raise ConfigError("--jobs and --dask: the cluster has its own; allowed: one of them")
    with _cluster(dask) as found, broken_named():
        yield found


def check_workplace(dask: str | None) -> None:
    """Refuse, before anything runs, a cluster that cannot be asked.

    Raises
    ------
    ConfigError : no address, and no scheduler file
    MissingLibraryError : Dask is not installed
    """
    if dask is not None:
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


@contextmanager
def _cluster(dask: str) -> Iterator[Workplace]:
    with _client(dask) as client:
        yield Workplace(client.get_executor(pure=False), _count(client, dask))


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
