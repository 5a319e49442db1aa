"""A node's process ends, whatever its middleware does."""

import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.ros


@pytest.mark.parametrize(("failed", "code"), [(False, -signal.SIGALRM), (True, 1)])
def test_a_middleware_that_never_returns_is_left(failed, code):
    """It may hold the interpreter too, so that no Python code runs any more."""
    lines = (
        "import ctypes",
        "from cam_rig.nodes import process",
        "process.MAX_TEARDOWN_S = 1",
        f"with process.bounded(failed={failed}): ctypes.PyDLL(None).sleep(600)",
    )
    ended = subprocess.run([sys.executable, "-c", "\n".join(lines)], check=False, timeout=100)
    assert ended.returncode == code


def test_a_bound_ends_with_what_it_is_for():
    """No alarm is left behind for the next run of a node that stays."""
    lines = (
        "import time",
        "from cam_rig.nodes import process",
        "process.MAX_TEARDOWN_S = 1",
        "for failed in (False, True):",
        "    with process.bounded(failed): pass",
        "time.sleep(1.5)",
    )
    ended = subprocess.run([sys.executable, "-c", "\n".join(lines)], check=False, timeout=100)
    assert ended.returncode == 0
