"""Helpers of the tests: ended commands, processes in /proc, and waits."""

import subprocess
import time
from contextlib import suppress
from pathlib import Path

#: Longest wait (s of wall-clock time) before a test fails, with room for a busy machine.
WAIT_S = 100.0


def ended(*command, **how):
    """Run a command to its end, and return its CompletedProcess with output as text."""
    words, pipes = [*map(str, command)], {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.run(words, text=True, check=False, **{"timeout": WAIT_S} | pipes | how)


def until(condition, said=lambda: "", step=lambda: time.sleep(0.01), wait=WAIT_S):
    """Wait until `condition()` is true, and return its value.

    After `wait` seconds of wall-clock time the test fails with the text of `said()`. `step` is
    called between checks of the condition.
    """
    end = time.monotonic() + wait
    while not (result := condition()):
        assert time.monotonic() < end, f"it never came true {said()}"
        step()
    return result


def text_of(place):
    """Return the text of a file in /proc, or an empty text if it does not exist."""
    try:
        return Path(place).read_text(encoding="utf-8")
    except OSError:
        return ""


def children(pid):
    """Return the command of each child process as a list of words, by process id."""
    found = " ".join(map(text_of, Path(f"/proc/{pid}/task").glob("*/children"))).split()
    return {int(child): text_of(f"/proc/{child}/cmdline").split("\0") for child in found}


def takes(pid, number):
    """Return True if a process has installed a handler for the signal `number`.

    `handle_signals` of cam_rig installs the handler of SIGHUP last, so that a handler for SIGHUP
    means that all are installed.
    """
    caught = text_of(f"/proc/{pid}/status").partition("SigCgt:")[2].split()
    return bool(caught) and bool(int(caught[0], 16) >> (number - 1) & 1)


def is_running(pid):
    """Return True if the process exists and has not ended."""
    stat = text_of(f"/proc/{pid}/stat")
    return stat != "" and stat.rpartition(")")[2].split()[0] != "Z"


def sockets(pid, *tables):
    """Return the rows that belong to a process in tables of /proc/net, such as tcp."""
    inodes = set()
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(OSError):  # closed after it was listed
            inodes.add(str(link.readlink()).removeprefix("socket:[").rstrip("]"))
    lines = (
        line
        for table in tables
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]
    )
    return [row for row in map(str.split, lines) if row[9] in inodes]
