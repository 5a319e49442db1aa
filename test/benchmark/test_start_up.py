"""What a start costs, as the tables of docs/accuracy.md have it."""

import subprocess

import pytest

from benchmark.speed import start_up


def test_a_command_counts_with_the_processes_it_waits_for():
    """Its own CPU time, and that of what it has started; beside a bare interpreter."""
    child = "import time\nwhile time.process_time() < 0.2: pass"
    parent = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    (found,) = start_up.command_times([("busy", ("-c", parent))], repeats=1)
    assert found.cpu_s > 0.2 and found.wall_s > 0.2
    words, *_, ratio = start_up.command_table([found]).rows[0]
    assert (words, ratio) == ("busy", found.wall_s / found.bare_s)


def test_a_command_that_fails_is_no_measurement():
    """It ends sooner than it should."""
    with pytest.raises(subprocess.CalledProcessError):
        start_up.command_times([("none", ("-c", "raise SystemExit(3)"))], repeats=1)


@pytest.mark.ros
def test_a_forked_node_has_little_left_to_import(monkeypatch):
    """A third of the modules that it imports by itself, at most."""
    monkeypatch.setattr(start_up, "NODES", ("follower",))
    (found,) = start_up.node_starts(repeats=1)
    assert 0 < 3 * found.forked_modules < found.alone_modules
    assert start_up.node_table([found]).rows[0][0] == "follower"
