"""A signal at any moment ends a command soon, with 128 and its number, and leaves nothing."""

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

pytestmark = pytest.mark.usefixtures("heard_hangup")
LONG = pytest.mark.long
#: Wall time (s) that a command may take to end; on a busy machine many times what it takes.
PATIENCE_S = 60.0
#: Wall time (s) that its children may take to go, who see that it has gone.
GRACE_S = 10.0
#: What a command is told by, in its environment and in that of all that it starts.
MARK = "CAM_RIG_TEST_SIGNALS"
#: Commands, and the wall time (s) within which they are signalled.
COMMANDS = {
    "panel --no-rerun --out {out}": 8.0,
    "view {golden} --web": 12.0,
    "run quick --bag {out}/bag": 12.0,
    "campaign tolerance_poly345 --points 64 --out {out}/rows --jobs 2": 10.0,
    "report quick --out {out}/quick.html": 10.0,
    "design poly345 --maximise jump_speed --limit peak_acceleration<=start --out {out}/a.yaml": 8.0,
}


def faults(command: str, folder: Path, number: int, group: bool, moments: list[float]) -> list[str]:
    """What should not be of a command that is signalled after so many seconds, and these again.

    It runs in a terminal's place: a session, folders and a ROS domain of its own. The seconds begin
    with its first line: before it a signal is the interpreter's, which loses one in a hundred.
    """
    places = {name: folder / name for name in ("tmp", "out", "home")}
    for place in places.values():
        place.mkdir(mode=0o700, parents=True)
    places["run"] = Path(tempfile.mkdtemp())  # a socket's path may have 107 bytes
    words = command.format(out=places["out"], golden=GOLDEN).split()
    environment = os.environ | {MARK: str(folder), "TMPDIR": str(places["tmp"])}
    environment |= {"XDG_RUNTIME_DIR": str(places["run"]), "ROS_LOG_DIR": str(places["home"])}
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
        left = _left(str(folder))
        printed.seek(0)
        said = printed.read().decode()
    left += [str(path) for name in ("tmp", "run") for path in places[name].rglob("*")]
    shutil.rmtree(places["run"])
    found = [f"left: {one}" for one in left if not one.endswith(".lock")]
    if code not in (128 + number, 0):
        found.append(f"code {code}")
    if code == 0 and "interrupted" in said:
        found.append("code 0")
    wrong = ("Traceback", "Exception ignored", "leaked", "Aborted")
    found += [word for word in wrong if word in said]
    return found and [*found, said]


def _left(mark: str) -> list[str]:
    deadline = time.monotonic() + GRACE_S
    while (found := list(_marked(mark))) and time.monotonic() < deadline:
        time.sleep(0.05)
    return found


def _marked(mark: str) -> Iterator[str]:
    wanted = f"{MARK}={mark}".encode()
    for entry in Path("/proc").iterdir():
        try:
            if entry.name.isdigit() and wanted in (entry / "environ").read_bytes().split(b"\0"):
                yield (entry / "cmdline").read_bytes().decode()
        except OSError:  # it has ended meanwhile, or is another user's
            continue


@pytest.mark.variants(2)
@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("count", [1, pytest.param(40, marks=LONG)])
def test_a_signal_at_any_moment(ros_domain: int, tmp_path: Path, command: str, count: int) -> None:
    """To the command or to its group as a terminal's, also twice; from its first line on."""
    draw = random.Random(f"{command} {count}")
    for i in range(count):
        after = draw.uniform(0.0, COMMANDS[command] if count > 1 else 3.0)
        number, group = draw.choice(STOPPING), draw.random() < 0.5
        moments = draw.choice([[after], [after, draw.uniform(0.0, 0.5)]])
        wrong = faults(command, tmp_path / str(i), number, group, moments)
        assert not wrong, (number, group, moments)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, pytest.param(30, marks=LONG)])
def test_a_signal_while_the_search_is_compiled(tmp_path: Path, count: int) -> None:
    """None is raised within numba, where one ended a process by SIGSEGV."""
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
        wanted = draw.choice(STOPPING)
        process.send_signal(wanted)
        _, printed = process.communicate(timeout=PATIENCE_S)
        assert (process.returncode, "Traceback" in printed) == (128 + wanted, False), printed
        assert not [path for path in empty.rglob("*") if path.is_file()]
