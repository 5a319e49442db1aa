"""Recordings of the golden run, and files that fail or are cut off during writing.

The golden run is a recording of the scene `quick`, stored in bags/golden as a reference.
"""

import io
import os
import signal
import time
import traceback
from itertools import count
from pathlib import Path

import numpy as np

from cam_rig.bag import files
from cam_rig.bag.files import bag_file
from cam_rig.bag.reader import raw_messages
from cam_rig.bag.recorder import BagRecorder
from cam_rig.messages.topics import RECORDING
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene

GOLDEN = Path(__file__).parents[2] / "bags" / "golden"
BY_NAME = {topic.name: topic for topic in RECORDING}
QUICK = config_root() / "scenes" / "quick.yaml"
#: Scene of the golden bag (the reference recording), loaded.
LOADED = open_scene(QUICK)


def record(bag, golden, **how):
    """Return an open recorder that has received all messages of the golden run.

    `golden` is the list of the fixture with this name. `how` has options of `BagRecorder`.
    """
    recorder = BagRecorder(bag, LOADED, **how)
    for topic, number, cdr in golden:
        recorder.take(topic, cdr, b"live", number)
    return recorder


def payloads(bag):
    """Return all messages of a bag as a dict from topic to (log time, bytes).

    The messages of a topic are in the order of the file. Diagnostics are sorted, because they may
    be later in the file than their time.
    """
    found = {}
    for connection, at, data in raw_messages(bag, set(BY_NAME)):
        found.setdefault(connection.topic, []).append((at, bytes(data)))
    if "/diagnostics" in found:
        found["/diagnostics"].sort()
    return found


def cut_off(bag, size, source=GOLDEN):
    """Write and return a truncated copy of a bag, as after a kill of the recorder.

    `size` is the number of bytes that are kept, or their fraction if it is less than 1.
    """
    data = bag_file(source).read_bytes()
    bag.mkdir()
    (bag / f"{bag.name}_0.mcap").write_bytes(data[: int(size * len(data)) if size < 1 else size])
    return bag


class WrappedFile(io.FileIO):
    """Unbuffered second handle of an open file. Its subclasses change how it writes."""

    def __init__(self, raw):
        super().__init__(os.dup(raw.fileno()), "w")
        raw.close()


class Dying(WrappedFile):
    """File that calls `step` before and within each write, and before truncation.

    A test uses `step` to kill the process at that moment.
    """

    def __init__(self, raw, step):
        super().__init__(raw)
        self._step = step

    def write(self, data):
        data = bytes(data)
        self._step()
        half = super().write(data[: len(data) // 2])
        self._step()
        return half + super().write(data[half:])

    def truncate(self, size=None):
        self._step()
        return super().truncate(size)


def _arm(step):
    """Make all file operations of this process call `step`, for example to kill it.

    `step` is called before and after each operation on folders and names, and around each write.
    """

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


def _forked(action, step):
    """Run an action in a forked process whose file operations call `step`.

    Return the wait status of the process. The action must end without an error or be killed.
    """
    child = os.fork()
    if child == 0:
        code = 3
        try:
            _arm(step)
            action()
            code = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0
    return status


def killed_bags(prepare, some):
    """Yield bags whose writing was killed, each at another file operation.

    `prepare(name)` returns a bag path and a function that writes the bag. `some` is the number of
    operations at which a process is killed, or 0 for all. A first complete run counts the
    operations.
    """
    seen, steps = os.pipe(), count()
    _forked(prepare("rehearsal")[1], lambda: os.write(seen[1], b"."))
    last = len(os.read(seen[0], 1 << 16)) - 1
    assert last > 10
    moments = np.linspace(0, last - 1, some or last).round().astype(int).tolist()

    def die_at(moment):
        if next(steps) == moment:
            os.kill(os.getpid(), signal.SIGKILL)

    for moment in moments:
        bag, action = prepare(str(moment))
        if os.WIFSIGNALED(_forked(action, lambda at=moment: die_at(at))):
            yield bag
        else:  # timed flushes vary in number
            assert moment > 0.8 * last


class Frugal:
    """Context manager that fails if its block needs 500 MB or 10 s of processor time."""

    def __enter__(self):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # resets the peak memory
        self._before, self._begun = peak_mb(), time.process_time()

    def __exit__(self, kind, *_):
        if kind is None:
            assert peak_mb() - self._before < 500 and time.process_time() - self._begun < 10


def peak_mb():
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024
