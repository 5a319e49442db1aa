"""Signals: a command ends soon and leaves no process or file."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from cam_rig.dynamics.events.backend import COMPILED, VARIABLE
from cam_rig.interrupts import STOPPING

from ..processes import takes, until
from .conftest import BIN, GOLDEN

pytestmark = pytest.mark.usefixtures("hangup_enabled")
LONG = pytest.mark.long
#: Wall-clock time (s) in which a command must end, ample for a busy machine.
PATIENCE_S = 60.0
#: Wall-clock time (s) in which its child processes must end after it.
GRACE_S = 10.0
#: Environment variable that identifies a command and all processes that it starts.
MARK = "CAM_RIG_TEST_SIGNALS"
#: Dict from command to the wall-clock time (s) within which it receives a signal.
COMMANDS = {
    "panel --no-rerun --out {out}": 8.0,
    "view {golden} --web": 12.0,
    "run quick --bag {out}/bag": 12.0,
    "campaign tolerance_poly345 --points 64 --out {out}/rows --jobs 2": 10.0,
    "report quick --out {out}/quick.html": 10.0,
    "design poly345 --maximise jump_speed --limit peak_acceleration<=start --out {out}/a.yaml": 8.0,
}


def find_faults(
    command: str, folder: Path, number: int, group: bool, moments: list[float]
) -> list[str]:
    """Send signals to a command and return all faults, with its output if any.

    The command runs in a separate session with separate folders. A signal is sent after each of the
    waits in `moments` (s, wall clock), which start when the command handles signals. Before that
    the interpreter handles signals, and loses one in a hundred. With `group` the signals go to the
    process group.
    """
    folders = {name: folder / name for name in ("tmp", "out", "home")}
    for path in folders.values():
        path.mkdir(mode=0o700, parents=True)
    folders["run"] = Path(tempfile.mkdtemp())  # a socket path may have 107 bytes
    words = command.format(out=folders["out"], golden=GOLDEN).split()
    environment = os.environ | {MARK: str(folder), "TMPDIR": str(folders["tmp"])}
    environment |= {"XDG_RUNTIME_DIR": str(folders["run"]), "ROS_LOG_DIR": str(folders["home"])}
    with open(folder / "printed", "w+b") as printed:
        process = subprocess.Popen(
            [BIN / "cam-rig", *words],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=printed,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            until(lambda: process.poll() is not None or takes(process.pid, signal.SIGHUP))
            for wait in moments:
                time.sleep(wait)
                if process.poll() is None:
                    (os.killpg if group else os.kill)(process.pid, number)
            code = process.wait(PATIENCE_S)
        finally:
            process.kill()
            process.wait(PATIENCE_S)
        remaining = remaining_processes(str(folder))
        printed.seek(0)
        output = printed.read().decode()
    remaining += [str(path) for name in ("tmp", "run") for path in folders[name].rglob("*")]
    shutil.rmtree(folders["run"])
    faults = [f"remaining: {name}" for name in remaining if not name.endswith(".lock")]
    if code not in (128 + number, 0):
        faults.append(f"code {code}")
    if code == 0 and "interrupted" in output:
        faults.append("code 0")
    wrong = ("Traceback", "Exception ignored", "leaked", "Aborted")
    faults += [word for word in wrong if word in output]
    return faults and [*faults, output]


def remaining_processes(mark: str) -> list[str]:
    """Return the commands of marked processes that have not ended after `GRACE_S`."""
    deadline = time.monotonic() + GRACE_S
    while (commands := list(marked_processes(mark))) and time.monotonic() < deadline:
        time.sleep(0.05)
    return commands


def marked_processes(mark: str) -> Iterator[str]:
    """Yield the command lines of processes with this mark in their environment."""
    variable = f"{MARK}={mark}".encode()
    for entry in Path("/proc").iterdir():
        try:
            if entry.name.isdigit() and variable in (entry / "environ").read_bytes().split(b"\0"):
                yield (entry / "cmdline").read_bytes().decode()
        except OSError:  # ended, or of another user
            continue


@pytest.mark.variants(2)
@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("count", [1, pytest.param(40, marks=LONG)])
def test_signal_at_a_random_time(ros_domain: int, tmp_path: Path, command: str, count: int) -> None:
    """A command that receives a signal at any time ends with code 128 + number.

    It leaves no process or file. One or two signals go to the command or to its group.
    """
    draw = random.Random(f"{command} {count}")
    for i in range(count):
        after = draw.uniform(0.0, COMMANDS[command] if count > 1 else 3.0)
        number, group = draw.choice(STOPPING), draw.random() < 0.5
        moments = draw.choice([[after], [after, draw.uniform(0.0, 0.5)]])
        faults = find_faults(command, tmp_path / str(i), number, group, moments)
        assert not faults, (number, group, moments)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, pytest.param(30, marks=LONG)])
def test_signal_during_compilation(tmp_path: Path, count: int) -> None:
    """A signal during compilation ends the command with code 128 + number.

    It is not raised within numba, where it could end the process by SIGSEGV.
    """
    draw = random.Random(count)
    for number in range(count):
        empty = tmp_path / str(number)
        process = subprocess.Popen(
            [BIN / "cam-rig", "jump", "poly345"],
            env=os.environ | {"NUMBA_CACHE_DIR": str(empty), VARIABLE: COMPILED},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert process.stderr is not None
        assert "compiling" in process.stderr.readline()
        time.sleep(draw.uniform(0.0, 3.0))
        sent = draw.choice(STOPPING)
        process.send_signal(sent)
        _, printed = process.communicate(timeout=PATIENCE_S)
        assert (process.returncode, "Traceback" in printed) == (128 + sent, False), printed
        assert {path.name for path in empty.rglob("*") if path.is_file()} <= {"lock"}
