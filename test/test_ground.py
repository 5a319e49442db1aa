"""Errors, files, units and arrays: what all rooms share."""

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
from cam_rig.units import correlation_length, rounded_to_error
from cam_rig.workers import check_workplace, workplace

from .cli.conftest import GOLDEN, call
from .processes import ended
from .references import References


def test_a_long_message_keeps_its_start_and_its_remedy() -> None:
    error = ConfigError(f"a: is {list(range(20_000))}; allowed: 3 numbers")
    for shortened in (str(error), str(copy.copy(error))):
        assert len(shortened) < HEAD_CHARACTERS + TAIL_CHARACTERS + 10
        assert shortened.startswith("a: is [0, 1, 2, ")
        assert shortened.endswith("; allowed: 3 numbers")
    whole = "x" * (HEAD_CHARACTERS + TAIL_CHARACTERS)
    assert str(CamRigError(whole)) == whole


def full(*_, **__):
    raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/tmp']")


def full_later(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize(
    "arguments",
    [["analyze", GOLDEN], ["replay", GOLDEN], ["view", GOLDEN, "--web"]],
    ids=lambda arguments: arguments[0],
)
def test_no_place_for_temporary_files_is_one_line(monkeypatch, tmp_path, arguments):
    """Code 1, and TMPDIR as the way out."""
    monkeypatch.setattr(tempfile, "gettempdir", full)
    result = call(*arguments)
    assert result.exit_code == 1
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert "No usable temporary directory" in result.stderr
    assert "name a folder with room in TMPDIR" in result.stderr


def test_a_disk_that_fills_while_files_are_unpacked_is_told_of(monkeypatch):
    monkeypatch.setattr(Path, "write_bytes", full_later)
    result = call("analyze", GOLDEN)
    assert result.exit_code == 1
    assert "(No space left on device); name a folder with room in TMPDIR" in result.stderr
    assert "recover" not in result.stderr


def test_a_folder_is_there_and_gone_or_told_of(monkeypatch):
    with temporary_folder() as folder:
        (folder / "file").touch()
    assert not folder.exists()
    monkeypatch.setattr(tempfile, "mkdtemp", full_later)
    with pytest.raises(OutputError, match="No space left on device"), temporary_folder():
        pass


@pytest.mark.parametrize(
    ("value", "error", "shown"),
    [
        (14.947876, 0.0323, "14.948"),
        (4042.31, 123.0, "4040"),
        (-0.001, 0.13, "0.00"),
        (3.3e8, 1.23e6, "3.300e+08"),
        (1e-9, 2.2e-11, "1.000e-09"),
        (14.947876, math.nan, "14.9479"),
    ],
)
def test_a_value_is_shown_to_two_digits_of_its_error(value, error, shown):
    assert rounded_to_error(value, error) == shown


def test_rounding_costs_less_than_a_twentieth_of_the_error():
    """Half a unit of the error's second digit, over 30 orders of value and error."""
    random = np.random.default_rng(0)
    for _ in range(500):
        error = 10.0 ** random.uniform(-15, 12)
        value = random.choice([-1, 1]) * error * 10.0 ** random.uniform(-3, 8)
        assert abs(float(rounded_to_error(value, error)) - value) <= 0.0501 * error


def test_neighbours_that_err_alike_are_counted_as_one():
    """Noise has length 1; each value eight times has length 8."""
    noise = np.random.default_rng(1).standard_normal(4000)
    assert correlation_length(noise) < 1.3
    assert correlation_length(np.repeat(noise, 8)) == pytest.approx(8.0, rel=0.2)


# -- where work is done: processes of this machine, a Dask cluster by address or by file ------


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
    found = ended(sys.executable, script).stdout.splitlines()
    rows = dict(line.split(":", maxsplit=1) for line in found if line)
    deaf = int(rows["SigBlk"], 16) | int(rows["SigIgn"], 16)
    assert [number for number in STOPPING if not deaf >> (number - 1) & 1] == []


SENDING = """
from cam_rig.workers import workers
if __name__ == "__main__":
    with workers(2) as pool:
        found = [pool.submit(bytes, 200_000_000) for _ in range(6)]
        found[0].result(timeout=100)
        raise KeyboardInterrupt
"""


def test_an_interrupt_while_a_result_is_sent(tmp_path):
    """The rest of what a killed worker was sending is not waited for."""
    script = tmp_path / "sending.py"
    script.write_text(SENDING, encoding="utf-8")
    done = ended(sys.executable, script)
    assert "KeyboardInterrupt" in done.stderr and done.returncode == -signal.SIGINT


#: Wall time (s) that what has ended may take to be gone, on a busy machine.
PATIENCE_S = 60.0


@pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
def test_an_interrupt_finds_no_pool_broken(monkeypatch) -> None:
    """A worker is killed with work to do that was dropped: nothing is printed, nobody waits."""
    kill = executors._Worker.kill

    def kill_and_wait(worker) -> None:
        kill(worker)
        follower.join(PATIENCE_S)  # the pool has seen that it has gone

    monkeypatch.setattr(executors._Worker, "kill", kill_and_wait)
    with pytest.raises(KeyboardInterrupt), executors.workers(1) as pool:
        for _ in pool.map(time.sleep, [0.0] + 40 * [PATIENCE_S]):
            follower = pool._executor_manager_thread
            raise KeyboardInterrupt
    assert not follower.is_alive()
    left = multiprocessing.active_children()
    assert not [child for child in left if isinstance(child, executors._Worker)]


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


# -- what the tests lean on: stored references, domains of their own, a limit to every wait


def test_a_reference_is_of_its_numbers_alone(tmp_path):
    path, values = tmp_path / "references" / "a.json", [np.pi, 1e-300]
    assert References("write", path, "t")(lambda: values, [3.0, [1e8, 1e-3]]).tolist() == values
    assert References("stored", path, "t")(pytest.fail, [3.0, [1e8, 1e-3]]).tolist() == values
    with pytest.raises(AssertionError, match="is of other numbers; run `make references`"):
        References("stored", path, "t")(pytest.fail, [3.0, [1e8, 1.0001e-3]])
    with pytest.raises(AssertionError, match="has no u:0"):
        References("stored", path, "u")(pytest.fail, [3.0])
    found = References("compute", path, "t")(lambda: values, [3.0, [1e8, 1e-3]])
    assert found.tolist() == values
    with pytest.raises(AssertionError, match="run `make references`"):
        References("compute", path, "t")(lambda: [3.14159265, 0.0], [3.0, [1e8, 1e-3]])
    assert list(json.loads(path.read_text(encoding="utf-8"))) == ["t:0"]


def test_no_two_hold_one_domain():
    with hold_domain() as one, hold_domain() as two:
        assert one != two
        assert {one, two} <= set(range(40, 101))


HERE = Path(__file__).parent
RUN = {"call", "check_call", "check_output", "run"}
#: Methods of processes, threads, futures, queues and events that wait for ever if given nothing.
ENDLESS = {"communicate", "get", "join", "result", "wait"}


def endless(text: str) -> Iterator[str]:
    """The calls of a module that wait, without a limit."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            name, given = node.func.attr, {keyword.arg for keyword in node.keywords}
            waits = name in ENDLESS and not node.args
            waits |= name in RUN and ast.unparse(node.func.value) == "subprocess"
            if (waits or name == "communicate") and not given & {"timeout", None}:
                yield f"line {node.lineno}: {ast.unparse(node)}"


@pytest.mark.parametrize("text", ["subprocess.run(['a'])", "a.wait()", "b().communicate('words')"])
def test_what_waits_for_ever_is_found(text: str) -> None:
    assert list(endless(text))
    assert not list(endless(f"{text[:-1]}, timeout=1)".replace("(, ", "(")))


def test_every_wait_of_a_test_has_a_limit() -> None:
    modules = {path: list(endless(path.read_text())) for path in HERE.rglob("*.py")}
    assert len(modules) > 100
    assert not {path: found for path, found in modules.items() if found}
