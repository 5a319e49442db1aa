"""The messages of the golden bag, as a recorder would take them."""

import io
import os
import signal
import time
import traceback
from itertools import count
from pathlib import Path

import pytest
from mcap.reader import make_reader

from cam_rig.bag import files
from cam_rig.bag.files import mcap_file
from cam_rig.messages import topics

from .wrapped_file import WrappedFile

GOLDEN = Path(__file__).parents[2] / "bags" / "golden"
BY_NAME = {topic.name: topic for topic in topics.RECORDING}


@pytest.fixture(scope="session")
def golden():
    """(topic, number of the message in its topic, bytes) in the order of the bag; received ones."""
    found, numbers = [], dict.fromkeys(BY_NAME, 0)
    with mcap_file(GOLDEN).open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            if BY_NAME[channel.topic].derived:
                continue
            numbers[channel.topic] += 1
            found.append((BY_NAME[channel.topic], numbers[channel.topic], message.data))
    return found


class Kept:
    """Stands in for the bag: keeps what was written."""

    def __init__(self):
        self.messages = []

    def write(self, topic, log_time, cdr):
        self.messages.append((topic.name, log_time, cdr))

    def begin_state(self, stamp):
        pass


@pytest.fixture
def kept():
    return Kept()


class Frugal:
    """What is done inside takes no more than 500 MB and 10 s of the processor."""

    def __enter__(self):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # resets the peak
        self._before, self._begun = peak_mb(), time.process_time()

    def __exit__(self, kind, *_):
        if kind is None:
            assert peak_mb() - self._before < 500
            assert time.process_time() - self._begun < 10


def peak_mb():
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


@pytest.fixture
def bounded():
    """A context in which memory and time are bounded."""
    return Frugal()


@pytest.fixture
def frugal(bounded):
    """The whole test is bounded in memory and time."""
    with bounded:
        yield


class Dying(WrappedFile):
    """A file in whose writing a process may be killed: before, halfway, after."""

    def __init__(self, raw, step):
        super().__init__(raw)
        self._step = step

    def write(self, data):
        data = bytes(data)
        self._step()
        half = self._raw.write(data[: len(data) // 2])
        self._step()
        return half + self._raw.write(data[half:])

    def truncate(self, size=None):
        self._step()
        return super().truncate(size)


def _arm(at):
    """From now on this process is killed at one of its steps on files."""
    steps = count()

    def step():
        if next(steps) == at:
            os.kill(os.getpid(), signal.SIGKILL)

    def around(function):
        def stepped(*arguments, **named):
            step()
            result = function(*arguments, **named)
            step()
            return result

        return stepped

    for name in ("fsync", "replace", "rename", "unlink", "mkdir", "rmdir"):
        setattr(os, name, around(getattr(os, name)))
    create = around(files.create)
    files.create = lambda file: io.BufferedWriter(Dying(create(file).detach(), step))


@pytest.fixture
def killed_at():
    """Do something in a process of its own that is killed at its n-th step on files.

    Whether it was; else it did all it had to do.
    """

    def run(at, action):
        child = os.fork()
        if child == 0:
            code = 3
            try:
                _arm(at)
                action()
                code = 0
            except BaseException:
                traceback.print_exc()
            finally:
                os._exit(code)
        _, status = os.waitpid(child, 0)
        assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0
        return os.WIFSIGNALED(status)

    return run
