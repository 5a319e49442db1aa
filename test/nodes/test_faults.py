"""A node is killed: the run ends, names it and the tick, and keeps what it has."""

import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from cam_rig.bag.reader import read_recording
from cam_rig.cli.main import app
from cam_rig.runner.node_process import stop_all

pytestmark = pytest.mark.ros
LONG = ("microphone", "follower", "law_server", "cam_drive")


@pytest.mark.parametrize(
    "victim", ["recorder", *(pytest.param(name, marks=pytest.mark.long) for name in LONG)]
)
def test_a_killed_node_ends_the_run(ros_domain, wait_for, rig, short_scene, tmp_path, victim):
    """Code 1, the node and the last tick named, the bag readable, nothing left behind."""
    bag, before = tmp_path / "bag", rig.unused()
    command = [sys.executable, "-m", "cam_rig.cli.main", "run", str(short_scene)]
    command += ["--bag", str(bag), "--pacing", "real_time"]
    run = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=dict(os.environ))
    wait_for(lambda: rig.size(bag) > 200_000)
    found = subprocess.run(
        ["pgrep", "-f", f"cam_rig.nodes.{victim} .*{short_scene}"],
        capture_output=True, text=True, check=True, timeout=100,
    )  # fmt: skip
    names = rig.mapped(*rig.processes(short_scene))
    subprocess.run(["kill", "-9", *found.stdout.split()], check=True, timeout=100)
    _, words = run.communicate(timeout=100)
    assert run.returncode == 1
    line = words.strip().splitlines()[-1]
    assert f"cam-rig: node {victim} was ended by signal 9 after tick " in line
    assert "rpm)" in line
    assert "what was recorded so far is in" in words
    assert 0 < len(read_recording(bag).ticks) < rig.ticks
    assert rig.processes(bag) == []
    assert (rig.unused() - before) & names == set()


@pytest.mark.long
def test_a_recorder_killed_while_all_are_ended_is_named(
    ros_domain, rig, short_scene, tmp_path, monkeypatch
):
    """After the drive's end, before the bag is closed: code 1, its name, the bag recovered."""

    def kill_recorder(nodes):
        for node in nodes:
            if node.name == "recorder":
                node.process.kill()
                node.process.wait(timeout=100)
        stop_all(nodes)

    monkeypatch.setattr("cam_rig.runner.graph.stop_all", kill_recorder)
    bag = tmp_path / "bag"
    result = CliRunner().invoke(app, ["run", str(short_scene), "--bag", str(bag)])
    assert result.exit_code == 1
    assert f"node recorder was ended by signal 9 after tick {rig.ticks}" in result.stderr
    assert "what was recorded so far is in" in result.stderr and "saved" in result.stderr
    assert 0 < len(read_recording(bag).ticks) <= rig.ticks


@pytest.mark.long
def test_a_full_disk_ends_the_run_with_its_name(ros_domain, rig, short_scene, tmp_path):
    """A file may grow to 300 kB here: the recorder reports what it could not write."""
    limited = "import resource as r; r.setrlimit(r.RLIMIT_FSIZE, (300_000, 300_000))"
    start = f"{limited}; import signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)"
    arguments = ["cam-rig", "run", str(short_scene), "--bag", str(tmp_path / "bag")]
    code = (
        f"{start}; import sys; sys.argv = {arguments!r}; from cam_rig.cli.main import main; main()"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=100
    )
    assert run.returncode == 1
    assert "cannot be written (File too large) after" in run.stderr
    assert "Traceback" not in run.stderr
    assert rig.processes(tmp_path) == []
