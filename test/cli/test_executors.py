"""Where work is done: processes of this machine, a Dask cluster by address or by file."""

import json
import os
import signal
import subprocess
import sys

import pytest
from distributed import LocalCluster

from cam_rig import workers as executors
from cam_rig.errors import ConfigError, RunError
from cam_rig.interrupts import STOPPING
from cam_rig.workers import check_workplace, workplace


def test_processes_are_others_than_this(monkeypatch):
    """As many as are asked for; by default one a core."""
    with workplace(1, None) as place:
        assert place.count == 1
        assert place.executor.submit(os.getpid).result(timeout=100) != os.getpid()
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    with workplace(None, None) as place:
        assert place.count == 3


TRACKED = """
from multiprocessing import resource_tracker
from cam_rig.workers import workers
if __name__ == "__main__":
    with workers(1) as pool:
        pool.submit(int).result(timeout=100)
        print(open(f"/proc/{resource_tracker._resource_tracker._pid}/status").read())
"""


def test_no_signal_to_a_command_ends_what_removes_its_leavings(tmp_path):
    """Python's resource tracker is of the terminal's group too: a hang-up killed it.

    The one that took its place knew of nothing, and printed a KeyError for each name.
    """
    script = tmp_path / "tracked.py"
    script.write_text(TRACKED, encoding="utf-8")
    found = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, check=True, timeout=100
    ).stdout
    rows = dict(line.split(":", maxsplit=1) for line in found.splitlines() if line)
    deaf = int(rows["SigBlk"], 16) | int(rows["SigIgn"], 16)
    assert [number for number in STOPPING if not deaf >> (number - 1) & 1] == []


def test_a_killed_worker_ends_a_command_in_a_line():
    """Whatever it computes, with what to do: no exception of the executor's own."""
    words = r"a worker .* is gone .*; remedy: "
    with pytest.raises(RunError, match=words), workplace(1, None) as place:
        worker = place.executor.submit(os.getpid).result(timeout=100)
        place.executor.submit(os.kill, worker, signal.SIGKILL).result(timeout=100)


@pytest.fixture(scope="module")
def cluster():
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0"
    ) as found:
        yield found


@pytest.mark.slow
def test_a_cluster_is_found_by_its_address_and_by_its_file(cluster, tmp_path):
    """Work is done in its worker, a process of its own."""
    file = tmp_path / "scheduler.json"
    file.write_text(json.dumps({"address": cluster.scheduler_address}), encoding="utf-8")
    for dask in (cluster.scheduler_address, str(file)):
        check_workplace(None, dask)
        with workplace(None, dask) as place:
            assert place.count == 1
            assert list(place.executor.map(pow, [2, 3], [5, 2])) == [32, 9]
            assert place.executor.submit(os.getpid).result(timeout=100) != os.getpid()


def test_where_nobody_answers_is_said_in_a_line(monkeypatch):
    """No scheduler at the address; neither an address nor a file; two places at once."""
    monkeypatch.setattr(executors, "WAIT_S", 0.3)
    with (
        pytest.raises(RunError, match="no scheduler answers"),
        workplace(None, "tcp://127.0.0.1:9"),
    ):
        pass
    with pytest.raises(ConfigError, match="allowed: an address"):
        check_workplace(None, "nowhere.json")
    with pytest.raises(ConfigError, match="allowed: one of them"), workplace(2, "tcp://x:1"):
        pass
