"""A signal at any moment ends a command soon, with 128 and its number, and leaves nothing."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from cam_rig.dynamics.events.search import ALWAYS, VARIABLE
from cam_rig.interrupts import STOPPING

from .conftest import BIN, GOLDEN

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
    "report --out {out}/report.html --jobs 2": 30.0,
    "design poly345 --maximise jump_speed --limit peak_acceleration<=start --out {out}/a.yaml": 8.0,
}
#: Of a process before its first own line: as of any program, the signal itself ends it.
BEFORE = {-number for number in STOPPING}


@dataclass
class Moment:
    """A command, when it is signalled, how, and what came of it."""

    command: str
    after: float
    number: int
    group: bool
    again: float | None
    folder: Path
    took: float = 0.0
    code: int = 0
    printed: str = ""
    left: list[str] = field(default_factory=list)

    def run(self) -> None:
        """Run it in a terminal's place: a session, folders and a ROS domain of its own."""
        places = {name: self.folder / name for name in ("tmp", "out", "home")}
        for place in places.values():
            place.mkdir(mode=0o700, parents=True)
        places["run"] = Path(tempfile.mkdtemp())  # a socket's path may have 107 bytes
        mark = str(self.folder)
        words = self.command.format(out=places["out"], golden=GOLDEN).split()
        environment = os.environ | {MARK: mark, "TMPDIR": str(places["tmp"])}
        environment |= {"XDG_RUNTIME_DIR": str(places["run"]), "ROS_LOG_DIR": str(places["home"])}
        with open(self.folder / "printed", "w+b") as printed:
            process = subprocess.Popen(
                [BIN / "cam-rig", *words],
                cwd=self.folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=printed,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            try:
                self._signal(process)
                begun = time.monotonic()
                self.code = process.wait(PATIENCE_S)
                self.took = time.monotonic() - begun
            finally:
                process.kill()
                process.wait(PATIENCE_S)
            self.left = _left(mark)
            printed.seek(0)
            self.printed = printed.read().decode()
        self.left += [str(p) for name in ("tmp", "run") for p in places[name].rglob("*")]
        self.left = [one for one in self.left if not one.endswith(".lock")]
        shutil.rmtree(places["run"])

    def _signal(self, process: subprocess.Popen[bytes]) -> None:
        send = os.killpg if self.group else os.kill
        for after in (self.after, self.again):
            if after is not None:
                time.sleep(after)
                if process.poll() is None:
                    send(process.pid, self.number)

    def faults(self) -> list[str]:
        """What should not be."""
        found = [f"left: {one}" for one in self.left]
        if self.code not in (128 + self.number, 0) and self.code not in BEFORE:
            found.append(f"code {self.code}")
        if self.code == 0 and "interrupted" in self.printed:
            found.append("code 0")
        for word in ("Traceback", "Exception ignored", "leaked", "Aborted"):
            if word in self.printed and self.code not in BEFORE:
                found.append(word)
        return found


def _left(mark: str) -> list[str]:
    """The command lines of processes that still run after a while."""
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
@pytest.mark.parametrize("count", [1, pytest.param(200, marks=LONG)])
def test_a_signal_at_any_moment(ros_domain: int, tmp_path: Path, command: str, count: int) -> None:
    """To the command or to its group as a terminal's, also twice; from its first line on."""
    draw = random.Random(f"{command} {count}")
    for number in range(count):
        moment = Moment(
            command,
            after=draw.uniform(0.0, COMMANDS[command] if count > 1 else 3.0),
            number=draw.choice(STOPPING),
            group=draw.random() < 0.5,
            again=draw.choice([None, draw.uniform(0.0, 0.5)]),
            folder=tmp_path / str(number),
        )
        moment.run()
        assert not moment.faults(), moment


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, pytest.param(30, marks=LONG)])
def test_a_signal_while_the_search_is_compiled(tmp_path: Path, count: int) -> None:
    """None is raised within numba, where one ended a process by SIGSEGV."""
    draw = random.Random(count)
    for number in range(count):
        empty = tmp_path / str(number)
        process = subprocess.Popen(
            [BIN / "cam-rig", "jump", "poly345"],
            env=os.environ | {"NUMBA_CACHE_DIR": str(empty), VARIABLE: ALWAYS},
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
