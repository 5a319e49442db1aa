"""An interrupt is raised where nothing is left half made, once, and decides the exit code."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest

from cam_rig.interrupts import STOPPING

from .processes import ended

pytestmark = pytest.mark.usefixtures("heard_hangup")
#: What every script begins with; `now` sends itself a signal.
BEGIN = """
import signal, sys, threading, time
from contextlib import ExitStack, contextmanager
from cam_rig.interrupts import Interrupted, handle_signals, interruptible, raised

def now(number=signal.SIGTERM):
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
    """The exit code of a script, the lines that it prints, and its stderr."""
    done = ended(sys.executable, "-c", BEGIN + script, cwd=folder)
    return done.returncode, done.stdout.splitlines(), done.stderr


#: Where most scenes act: what is raised within is printed.
SCENE = """
try:
    with raised():
        {}
        print("never")
except Interrupted as error:
    print(error)
"""
RAISED = "interrupted by SIGTERM"
#: Scripts by what they show, with the lines that each prints; each ends with 143.
SCENES = {
    "an import is finished, and no lock of it is held": (
        """
open("slow.py", "w").write("import __main__; __main__.now(); done = True")
sys.path.insert(0, ".")
def ask():
    import slow
    print("imported", slow.done)
try:
    with raised():
        import slow
        print("never")
except Interrupted:
    thread = threading.Thread(target=ask)
    thread.start()
    thread.join(50)
""",
        ["imported True"],
    ),
    "what a `with` makes is removed": (
        SCENE.format("with resource(enter=now):\n            print('never')"),
        ["made", "removed", RAISED],
    ),
    "also of an ExitStack": (
        """
try:
    with raised(), ExitStack() as stack:
        stack.enter_context(resource(enter=now))
        print("never")
except Interrupted:
    pass
""",
        ["made", "removed"],
    ),
    "signals do not disturb what is being removed": (
        "more = lambda: (now(), now(signal.SIGINT), now(signal.SIGHUP))"
        + SCENE.format("with resource(leave=more):\n            now()"),
        ["made", "removed", RAISED],
    ),
    "one that comes while a resource is removed is raised afterwards": (
        SCENE.format("with resource(leave=now):\n            print('body')"),
        ["made", "body", "removed", RAISED],
    ),
    "a wait within the begin of a `with` is cut short": (
        """
@interruptible
def wait():
    now()
    print("never")
"""
        + SCENE.format("with resource(enter=wait):\n            print('never')"),
        [RAISED],
    ),
    "and so is one that begins after the signal": (
        """
@interruptible
def wait():
    print("never")
def both():
    now()
    wait()
"""
        + SCENE.format("with resource(enter=both):\n            print('never')"),
        [RAISED],
    ),
    "in a destructor, where nothing can be raised, it is raised after it": (
        """
class Dying:
    def __del__(self):
        now()
        for _ in range(3):
            pass
def let_die():
    Dying()
    return None
"""
        + SCENE.format("let_die()"),
        [RAISED],
    ),
    "what compiled code makes of it is an interrupt again": (
        """
from matplotlib import _path
class Lost:
    def __array__(self, *_, **__):
        now()
"""
        + SCENE.format("_path.affine_transform([[0.0, 0.0]], Lost())"),
        [RAISED],
    ),
    "one that came before is raised at the begin": ("now()" + SCENE.format(""), [RAISED]),
    "whoever keeps what there is ends with its code all the same": (
        """
with raised():
    try:
        now()
    except KeyboardInterrupt:
        print("kept")
print("written")
sys.exit(0)
""",
        ["kept", "written"],
    ),
    "also where it came when all was done": ("now()\nprint('done')\n", ["done"]),
    "also where it came at the very end": ("import atexit; atexit.register(now)", []),
    "also where an error follows from it": ("now()\nsys.exit('gone')", []),
}


@pytest.mark.parametrize("name", SCENES)
def test_where_an_interrupt_is_raised(name: str, tmp_path: Path) -> None:
    """The scene's lines, no traceback, and 128 + signal."""
    script, lines = SCENES[name]
    code, printed, errors = run(script, tmp_path)
    assert printed == lines
    assert errors in ("", "gone\n")
    assert code == 128 + signal.SIGTERM


def test_a_library_that_never_comes_back_is_left(tmp_path: Path) -> None:
    """Its call holds the main thread, in which alone an interrupt can be raised."""
    script = """
import ctypes, os
lock, held = ctypes.CDLL(None).pthread_mutex_lock, ctypes.byref((ctypes.c_char * 64)())
lock(held)
with raised():
    threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGTERM)).start()
    lock(held)
"""
    code, _, errors = run(script, tmp_path)
    assert (code, errors) == (128 + signal.SIGTERM, "")


@pytest.mark.parametrize("number", STOPPING)
def test_a_signal_after_the_end_changes_nothing(number: signal.Signals, tmp_path: Path) -> None:
    """The interpreter takes its modules down: the command's work and code are settled."""
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
    """As a shell has it; the others change nothing."""
    others = "".join(f"now({int(one)})\n" for one in STOPPING)
    code, _, errors = run(f"now({int(number)})\n{others}", tmp_path)
    assert (code, errors) == (128 + number, "")


def test_what_is_ignored_on_purpose_stays_so(tmp_path: Path) -> None:
    """Behind nohup a closed terminal ends nothing; Ctrl-C's signal is taken wherever it is sent."""
    script = """
for number in (signal.SIGHUP, signal.SIGINT):
    signal.signal(number, signal.SIG_IGN)
handle_signals()
now(signal.SIGHUP)
print("on")
with raised():
    now(signal.SIGINT)
"""
    code, printed, errors = run(script, tmp_path)
    assert (code, printed) == (128 + signal.SIGINT, ["on"])
    assert errors.splitlines()[-1].endswith("Interrupted: interrupted by SIGINT")
