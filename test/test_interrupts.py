"""Tests of interrupts: where a signal is raised, and the resulting exit code.

Each test runs a script in a separate process, which sends the signal to itself.
"""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest

from cam_rig.interrupts import STOPPING

from .processes import ended

pytestmark = pytest.mark.usefixtures("hangup_enabled")
#: First lines of each script. Their function `send_signal` sends a signal to the script's process.
PRELUDE = """
import signal, sys, threading, time
from contextlib import ExitStack, contextmanager
from cam_rig.interrupts import Interrupted, handle_signals, interruptible, raise_signals

def send_signal(number=signal.SIGTERM):
    signal.raise_signal(number)

@contextmanager
def resource(enter=lambda: None, leave=lambda: None):
    enter()
    print("made")
    try:
        yield
    finally:
        leave()
        print("removed")

handle_signals()
"""


def run(script: str, folder: Path) -> tuple[int, list[str], str]:
    """Run a script and return its exit code, the lines of its stdout, and its stderr."""
    done = ended(sys.executable, "-c", PRELUDE + script, cwd=folder)
    return done.returncode, done.stdout.splitlines(), done.stderr


#: Body of most scripts. It runs the code of a case and prints the interrupt that is raised there.
SCENE = """
try:
    with raise_signals():
        {}
        print("never")
except Interrupted as error:
    print(error)
"""
RAISED = "interrupted by SIGTERM"
#: Cases by their promise: a script and the lines that it must print. Its exit code must be 143.
SCENES = {
    "an import is completed, and its lock released": (
        """
open("slow.py", "w").write("import __main__; __main__.send_signal(); done = True")
sys.path.insert(0, ".")
def import_again():
    import slow
    print("imported", slow.done)
try:
    with raise_signals():
        import slow
        print("never")
except Interrupted:
    thread = threading.Thread(target=import_again)
    thread.start()
    thread.join(50)
""",
        ["imported True"],
    ),
    "the resource of a `with` block is removed": (
        SCENE.format("with resource(enter=send_signal):\n            print('never')"),
        ["made", "removed", RAISED],
    ),
    "the resource of an ExitStack is removed": (
        """
try:
    with raise_signals(), ExitStack() as stack:
        stack.enter_context(resource(enter=send_signal))
        print("never")
except Interrupted:
    pass
""",
        ["made", "removed"],
    ),
    "later signals do not disturb the removal of a resource": (
        "more = lambda: (send_signal(), send_signal(signal.SIGINT), send_signal(signal.SIGHUP))"
        + SCENE.format("with resource(leave=more):\n            send_signal()"),
        ["made", "removed", RAISED],
    ),
    "a signal during the removal of a resource is raised afterwards": (
        SCENE.format("with resource(leave=send_signal):\n            print('body')"),
        ["made", "body", "removed", RAISED],
    ),
    "an interruptible wait in the entry of a `with` block is interrupted": (
        """
@interruptible
def wait():
    send_signal()
    print("never")
"""
        + SCENE.format("with resource(enter=wait):\n            print('never')"),
        [RAISED],
    ),
    "an interruptible wait that starts after the signal is interrupted": (
        """
@interruptible
def wait():
    print("never")
def both():
    send_signal()
    wait()
"""
        + SCENE.format("with resource(enter=both):\n            print('never')"),
        [RAISED],
    ),
    "a signal in a destructor is raised after it": (
        """
class Dying:
    def __del__(self):
        send_signal()
        for _ in range(3):
            pass
def let_die():
    Dying()
    return None
"""
        + SCENE.format("let_die()"),
        [RAISED],
    ),
    "an interrupt that compiled code replaces by another error is raised again": (
        """
from matplotlib import _path
class Lost:
    def __array__(self, *_, **__):
        send_signal()
"""
        + SCENE.format("_path.affine_transform([[0.0, 0.0]], Lost())"),
        [RAISED],
    ),
    "an earlier signal is raised at the start of the context": (
        "send_signal()" + SCENE.format(""),
        [RAISED],
    ),
    "a command that catches the interrupt ends with its exit code": (
        """
with raise_signals():
    try:
        send_signal()
    except KeyboardInterrupt:
        print("kept")
print("written")
sys.exit(0)
""",
        ["kept", "written"],
    ),
    "a command ends with the exit code of a signal after its work": (
        "send_signal()\nprint('done')\n",
        ["done"],
    ),
    "a command ends with the exit code of a signal in an atexit function": (
        "import atexit; atexit.register(send_signal)",
        [],
    ),
    "a command ends with the exit code of a signal before an error": (
        "send_signal()\nsys.exit('gone')",
        [],
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_where_an_interrupt_is_raised(name: str, tmp_path: Path) -> None:
    """A script that a signal interrupts prints the lines that belong to its case.

    It prints no traceback, and its exit code is 128 + number of the signal.
    """
    script, lines = SCENES[name]
    code, printed, errors = run(script, tmp_path)
    assert printed == lines
    assert errors in ("", "gone\n")
    assert code == 128 + signal.SIGTERM


def test_a_library_that_never_returns_is_ended(tmp_path: Path) -> None:
    """A signal ends a command whose main thread is blocked within a library.

    Python cannot raise an interrupt there. The exit code is 128 + number of the signal.
    """
    script = """
import ctypes, os
lock, held = ctypes.CDLL(None).pthread_mutex_lock, ctypes.byref((ctypes.c_char * 64)())
lock(held)
with raise_signals():
    threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGTERM)).start()
    lock(held)
"""
    code, _, errors = run(script, tmp_path)
    assert (code, errors) == (128 + signal.SIGTERM, "")


@pytest.mark.parametrize("number", STOPPING)
def test_a_signal_after_the_end_changes_nothing(number: signal.Signals, tmp_path: Path) -> None:
    """A signal while the interpreter shuts down changes neither exit code nor output."""
    script = f"""
class Last:
    def __del__(self, number={int(number)}, send=signal.raise_signal):
        print("down")
        send(number)
last = Last()
"""
    assert run(script, tmp_path) == (0, ["down"], "")


@pytest.mark.parametrize("number", STOPPING)
def test_the_code_is_that_of_the_first_signal(number: signal.Signals, tmp_path: Path) -> None:
    """After several signals the exit code is 128 + number of the first signal.

    Later signals are ignored.
    """
    others = "".join(f"send_signal({int(other)})\n" for other in STOPPING)
    code, _, errors = run(f"send_signal({int(number)})\n{others}", tmp_path)
    assert (code, errors) == (128 + number, "")


def test_an_ignored_hangup_stays_ignored_but_not_an_ignored_interrupt(tmp_path: Path) -> None:
    """SIGHUP remains ignored, as under nohup. SIGINT is raised even if it was ignored."""
    script = """
for number in (signal.SIGHUP, signal.SIGINT):
    signal.signal(number, signal.SIG_IGN)
handle_signals()
send_signal(signal.SIGHUP)
print("on")
with raise_signals():
    send_signal(signal.SIGINT)
"""
    code, printed, errors = run(script, tmp_path)
    assert (code, printed) == (128 + signal.SIGINT, ["on"])
    assert errors.splitlines()[-1].endswith("Interrupted: interrupted by SIGINT")
