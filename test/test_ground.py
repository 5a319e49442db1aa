"""Tests of errors, rounding, temporary folders, worker processes and test helpers."""

from __future__ import annotations

import ast
import copy
import errno
import json
import math
import multiprocessing
import os
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from distributed import LocalCluster

from cam_rig import workers as executors
from cam_rig.errors import (
    HEAD_CHARACTERS,
    TAIL_CHARACTERS,
    CamRigError,
    ConfigError,
    OutputError,
    RunError,
)
from cam_rig.files import temporary_folder
from cam_rig.interrupts import STOPPING
from cam_rig.testing.running_rig import hold_domain
from cam_rig.units import correlation_length, round_to_error
from cam_rig.workers import check_executor_options, executor_pool

from .cli.conftest import GOLDEN, call
from .processes import ended
from .references import References


def test_a_long_message_keeps_its_start_and_its_remedy() -> None:
    """A long error message is shortened in the middle, also in a copy of the error.

    A message up to the maximum length is not changed.
    """
    error = ConfigError(f"a: is {list(range(20_000))}; allowed: 3 numbers")
    for shortened in (str(error), str(copy.copy(error))):
        assert len(shortened) < HEAD_CHARACTERS + TAIL_CHARACTERS + 10
        assert shortened.startswith("a: is [0, 1, 2, ")
        assert shortened.endswith("; allowed: 3 numbers")
    whole = "x" * (HEAD_CHARACTERS + TAIL_CHARACTERS)
    assert str(CamRigError(whole)) == whole


def raise_no_folder(*_, **__):
    raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/tmp']")


def raise_disk_full(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize(
    "arguments",
    [["analyze", GOLDEN], ["replay", GOLDEN], ["view", GOLDEN, "--web"]],
    ids=lambda arguments: arguments[0],
)
def test_no_folder_for_temporary_files_is_an_error_of_one_line(monkeypatch, tmp_path, arguments):
    """Without a usable temporary folder a command ends with code 1.

    The error suggests the variable TMPDIR.
    """
    monkeypatch.setattr(tempfile, "gettempdir", raise_no_folder)
    result = call(*arguments)
    assert result.exit_code == 1
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert "No usable temporary directory" in result.stderr
    assert "name a folder with room in TMPDIR" in result.stderr


def test_a_disk_that_fills_while_files_are_unpacked_is_reported(monkeypatch):
    """`analyze` on a full disk ends with code 1, and suggests the variable TMPDIR.

    It does not suggest the command recover, because the bag is not damaged.
    """
    monkeypatch.setattr(Path, "write_bytes", raise_disk_full)
    result = call("analyze", GOLDEN)
    assert result.exit_code == 1
    assert "(No space left on device); name a folder with room in TMPDIR" in result.stderr
    assert "recover" not in result.stderr


def test_a_temporary_folder_is_removed_and_a_full_disk_reported(monkeypatch):
    """`temporary_folder` removes its folder at the end.

    On a full disk it raises OutputError.
    """
    with temporary_folder() as folder:
        (folder / "file").touch()
    assert not folder.exists()
    monkeypatch.setattr(tempfile, "mkdtemp", raise_disk_full)
    with pytest.raises(OutputError, match="No space left on device"), temporary_folder():
        pass


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (14.947876, 0.0323, "14.948"),
        (4042.31, 123.0, "4040"),
        (-0.001, 0.13, "0.00"),
        (3.3e8, 1.23e6, "3.300e+08"),
        (1e-9, 2.2e-11, "1.000e-09"),
        (14.947876, math.nan, "14.9479"),
    ],
)
def test_a_value_is_rounded_to_two_digits_of_its_error(value, error, text):
    """`round_to_error` returns the value as text with two digits of its error.

    If the error is NaN, the value has six digits.
    """
    assert round_to_error(value, error) == text


def test_rounding_changes_a_value_by_less_than_a_twentieth_of_its_error():
    """`round_to_error` changes a random value by at most 5 % of its error."""
    random = np.random.default_rng(0)
    for _ in range(500):
        error = 10.0 ** random.uniform(-15, 12)
        value = random.choice([-1, 1]) * error * 10.0 ** random.uniform(-3, 8)
        assert abs(float(round_to_error(value, error)) - value) <= 0.0501 * error


def test_correlation_length_of_noise_and_of_repeated_values():
    """The correlation length is 1 for white noise, and 8 for values repeated 8 times.

    The tolerances, 0.3 and 20 %, are those of 4000 random values.
    """
    noise = np.random.default_rng(1).standard_normal(4000)
    assert correlation_length(noise) < 1.3
    assert correlation_length(np.repeat(noise, 8)) == pytest.approx(8.0, rel=0.2)


# -- workers: processes of this machine, or a Dask cluster by its address or its file


def test_work_is_done_in_other_processes(monkeypatch):
    """`executor_pool` runs work in as many other processes as requested.

    The default is the number of cores.
    """
    with executor_pool(1, None) as workers:
        assert workers.count == 1
        assert workers.executor.submit(os.getpid).result(timeout=100) != os.getpid()
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    with executor_pool(None, None) as workers:
        assert workers.count == 3


TRACKED = """
from multiprocessing import resource_tracker
from cam_rig.workers import workers
if __name__ == "__main__":
    with workers(1) as pool:
        pool.submit(int).result(timeout=100)
        print(open(f"/proc/{resource_tracker._resource_tracker._pid}/status").read())
"""


def test_the_resource_tracker_ignores_the_signals_that_end_a_command(tmp_path):
    """Python's resource tracker blocks or ignores each signal that ends a command.

    Otherwise the SIGHUP of a closed terminal would kill it. Python would replace it by a tracker
    that does not know the resources and prints a KeyError for each.
    """
    script = tmp_path / "tracked.py"
    script.write_text(TRACKED, encoding="utf-8")
    lines = ended(sys.executable, script).stdout.splitlines()
    status = dict(line.split(":", maxsplit=1) for line in lines if line)
    ignored = int(status["SigBlk"], 16) | int(status["SigIgn"], 16)
    assert [number for number in STOPPING if not ignored >> (number - 1) & 1] == []


SENDING = """
from cam_rig.workers import workers
if __name__ == "__main__":
    with workers(2) as pool:
        futures = [pool.submit(bytes, 200_000_000) for _ in range(6)]
        futures[0].result(timeout=100)
        raise KeyboardInterrupt
"""


def test_an_interrupt_while_a_result_is_sent(tmp_path):
    """An interrupt ends a command although its workers are sending large results."""
    script = tmp_path / "sending.py"
    script.write_text(SENDING, encoding="utf-8")
    done = ended(sys.executable, script)
    assert "KeyboardInterrupt" in done.stderr and done.returncode == -signal.SIGINT


#: Longest wall time (s) until an ended process disappears, on a busy machine.
PATIENCE_S = 60.0


@pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
def test_an_interrupt_does_not_break_the_pool(monkeypatch) -> None:
    """An interrupt ends all workers and their manager thread without an error.

    The remaining tasks are dropped.
    """
    kill = executors._Worker.kill

    def kill_and_wait(worker) -> None:
        kill(worker)
        manager.join(PATIENCE_S)  # until the pool has noticed that the worker is gone

    monkeypatch.setattr(executors._Worker, "kill", kill_and_wait)
    with pytest.raises(KeyboardInterrupt), executors.workers(1) as pool:
        for _ in pool.map(time.sleep, [0.0] + 40 * [PATIENCE_S]):
            manager = pool._executor_manager_thread
            raise KeyboardInterrupt
    assert not manager.is_alive()
    children = multiprocessing.active_children()
    assert not [child for child in children if isinstance(child, executors._Worker)]


def test_a_killed_worker_is_an_error_of_one_line():
    """A killed worker raises RunError of one line that suggests a remedy."""
    message = r"a worker .* is gone .*; remedy: "
    with pytest.raises(RunError, match=message), executor_pool(1, None) as workers:
        worker = workers.executor.submit(os.getpid).result(timeout=100)
        workers.executor.submit(os.kill, worker, signal.SIGKILL).result(timeout=100)


@pytest.fixture(scope="module")
def cluster():
    """Dask cluster of one worker process on this machine."""
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0"
    ) as local_cluster:
        yield local_cluster


@pytest.mark.slow
def test_a_cluster_is_used_by_its_address_and_by_its_file(cluster, tmp_path):
    """Work runs in a worker of a Dask cluster, given by its address or its file."""
    file = tmp_path / "scheduler.json"
    file.write_text(json.dumps({"address": cluster.scheduler_address}), encoding="utf-8")
    for dask in (cluster.scheduler_address, str(file)):
        check_executor_options(None, dask)
        with executor_pool(None, dask) as workers:
            assert workers.count == 1
            assert list(workers.executor.map(pow, [2, 3], [5, 2])) == [32, 9]
            assert workers.executor.submit(os.getpid).result(timeout=100) != os.getpid()


def test_a_wrong_cluster_is_an_error_of_one_line(monkeypatch):
    """A Dask cluster that does not answer raises an error of one line.

    The same applies to a missing file, and to a cluster together with a number of jobs.
    """
    monkeypatch.setattr(executors, "WAIT_S", 0.3)
    with (
        pytest.raises(RunError, match="no scheduler answers"),
        executor_pool(None, "tcp://127.0.0.1:9"),
    ):
        pass
    with pytest.raises(ConfigError, match="allowed: an address"):
        check_executor_options(None, "nowhere.json")
    with (
        pytest.raises(ConfigError, match="cannot be combined with --dask"),
        executor_pool(2, "tcp://x:1"),
    ):
        pass


# -- helpers of the tests: stored references, separate ROS domains, a limit for every wait


def test_a_reference_is_rejected_for_other_numbers(tmp_path):
    """Stored reference values are rejected if they are missing or their inputs differ.

    In the mode `compute` they are also rejected if the computed values differ.
    """
    path, values = tmp_path / "references" / "a.json", [np.pi, 1e-300]
    assert References("write", path, "t")(lambda: values, [3.0, [1e8, 1e-3]]).tolist() == values
    assert References("stored", path, "t")(pytest.fail, [3.0, [1e8, 1e-3]]).tolist() == values
    with pytest.raises(AssertionError, match="is of other numbers; run `make references`"):
        References("stored", path, "t")(pytest.fail, [3.0, [1e8, 1.0001e-3]])
    with pytest.raises(AssertionError, match="has no u:0"):
        References("stored", path, "u")(pytest.fail, [3.0])
    computed = References("compute", path, "t")(lambda: values, [3.0, [1e8, 1e-3]])
    assert computed.tolist() == values
    with pytest.raises(AssertionError, match="run `make references`"):
        References("compute", path, "t")(lambda: [3.14159265, 0.0], [3.0, [1e8, 1e-3]])
    assert list(json.loads(path.read_text(encoding="utf-8"))) == ["t:0"]


def test_two_runs_have_different_domains():
    """Two simultaneous test runs have different ROS domains from 40 to 100."""
    with hold_domain() as first, hold_domain() as second:
        assert first != second
        assert {first, second} <= set(range(40, 101))


HERE = Path(__file__).parent
#: Functions of the module subprocess that wait for a process.
RUN = {"call", "check_call", "check_output", "run"}
#: Methods of processes, threads, futures, queues and events that wait without a default limit.
ENDLESS = {"communicate", "get", "join", "result", "wait"}


def endless(text: str) -> Iterator[str]:
    """Yield the calls in the code of a module that wait without a limit."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            name, keywords = node.func.attr, {keyword.arg for keyword in node.keywords}
            waits = name in ENDLESS and not node.args
            waits |= name in RUN and ast.unparse(node.func.value) == "subprocess"
            if (waits or name == "communicate") and not keywords & {"timeout", None}:
                yield f"line {node.lineno}: {ast.unparse(node)}"


@pytest.mark.parametrize("text", ["subprocess.run(['a'])", "a.wait()", "b().communicate('words')"])
def test_endless_waits_are_detected(text: str) -> None:
    """`endless` detects a wait without a timeout, but not a wait with a timeout."""
    assert list(endless(text))
    assert not list(endless(f"{text[:-1]}, timeout=1)".replace("(, ", "(")))


def test_every_wait_of_a_test_has_a_limit() -> None:
    """No module of the tests contains a wait without a timeout."""
    modules = {path: list(endless(path.read_text())) for path in HERE.rglob("*.py")}
    assert len(modules) > 100
    assert not {path: calls for path, calls in modules.items() if calls}
