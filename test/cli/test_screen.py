"""What a run is shown on: a server that is gone is not waited for."""

import subprocess
import sys
from pathlib import Path

import pytest

from cam_rig.cli.common.screen import open_screen, stay_until_interrupted
from cam_rig.errors import CamRigError


def test_a_server_that_was_killed_is_told_of(capsys):
    """It died while the run was on: afterwards the command says so, and ends."""
    with open_screen(view=False, web=True) as screen:
        assert capsys.readouterr().out.startswith("http://127.0.0.1:")
        found = subprocess.run(
            ["pgrep", "-f", f"web.*{screen.address.split(':')[2].split('/')[0]}"],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        subprocess.run(["kill", "-9", *found.stdout.split()], check=True)
        with pytest.raises(CamRigError, match="the viewer's server ended with code -9"):
            screen.stay()


def test_ctrl_c_ends_it_as_it_is_meant_to(monkeypatch):
    """No error, for that is what one is told to press."""
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:

        def interrupted():
            raise KeyboardInterrupt

        monkeypatch.setattr(process, "wait", interrupted)
        stay_until_interrupted(process)
        monkeypatch.undo()
        process.stdin.close()
        process.wait()


def test_waiting_needs_somebody_to_wait_for(tmp_path):
    """The error names what to add, before anything is started."""
    command = [Path(sys.executable).with_name("cam-rig"), "run", "quick", "--wait"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 2
    assert "--wait: waits for a viewer" in done.stderr
    assert not list(tmp_path.iterdir())
