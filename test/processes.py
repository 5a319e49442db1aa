"""What Linux's own tables tell of processes, and a wait for what they do."""

import subprocess
import time
from contextlib import suppress
from pathlib import Path

#: Wall time (s) after which something that has not come true never will, however busy the machine.
WAIT_S = 100.0


def ended(*command, **how):
    """Return a process that has ended, with its output as text."""
    words, pipes = [*map(str, command)], {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.run(words, text=True, check=False, **{"timeout": WAIT_S} | pipes | how)


def until(condition, said=lambda: "", step=lambda: time.sleep(0.01), wait=WAIT_S):
    """Wait step by step until a condition that another thread or process meets, and return it."""
    end = time.monotonic() + wait
    while not (result := condition()):
        assert time.monotonic() < end, f"it never came true {said()}"
        step()
    return result


def text_of(place):
    """What stands at a place in /proc; nothing where it has gone meanwhile."""
    try:
        return Path(place).read_text(encoding="utf-8")
    except OSError:
        return ""


def children(pid):
    """The words of each process's command that one has begun, by their numbers."""
    found = " ".join(map(text_of, Path(f"/proc/{pid}/task").glob("*/children"))).split()
    return {int(child): text_of(f"/proc/{child}/cmdline").split("\0") for child in found}


def takes(pid, number):
    """Whether a process handles a signal; `handle_signals` sets that of a hang-up last."""
    caught = text_of(f"/proc/{pid}/status").partition("SigCgt:")[2].split()
    return bool(caught) and bool(int(caught[0], 16) >> (number - 1) & 1)


def is_running(pid):
    """Whether there is such a process that has not ended."""
    stat = text_of(f"/proc/{pid}/stat")
    return stat != "" and stat.rpartition(")")[2].split()[0] != "Z"


def sockets(pid, *tables):
    """The rows of tables, such as tcp and udp6, that are of a process's sockets, cell by cell."""
    inodes = set()
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(OSError):  # closed since it was listed
            inodes.add(str(link.readlink()).removeprefix("socket:[").rstrip("]"))
    lines = (
        line
        for table in tables
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]
    )
    return [row for row in map(str.split, lines) if row[9] in inodes]
