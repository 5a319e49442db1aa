"""The folder of checkpoints is removed with its run, or with the next."""

import os
import subprocess
import sys
import time

from cam_rig.runner.resources import PREFIX, CheckpointFolder

MAKE = """
import sys; from pathlib import Path; from cam_rig.runner.resources import CheckpointFolder
folder = CheckpointFolder(Path(sys.argv[1])); (folder.path / "follower.json").touch()
print(folder.path, flush=True); input()
"""


def age(folder):
    """As if it had been made a while ago."""
    then = time.time() - 60.0
    os.utime(folder, (then, then))


def test_what_a_killed_run_left_goes_with_the_next(tmp_path):
    """While it runs its folder stays, whatever its age; other folders always do."""
    (tmp_path / "cam_rig-replay-x").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / f"{PREFIX}link").symlink_to(tmp_path / "elsewhere")
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", MAKE, tmp_path], text=True, **pipes) as other:
        name = other.stdout.readline().strip()
        age(name)
        mine = CheckpointFolder(tmp_path)
        assert os.path.isdir(name)
        other.kill()
        other.wait(timeout=100)
    CheckpointFolder(tmp_path).remove()
    assert not os.path.exists(name)
    assert mine.path.is_dir()
    mine.remove()
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"cam_rig-replay-x", "elsewhere", f"{PREFIX}link"}


def test_one_that_was_just_made_stays(tmp_path):
    """Between its making and its lock it may not be removed."""
    (tmp_path / f"{PREFIX}new").mkdir()
    CheckpointFolder(tmp_path).remove()
    assert (tmp_path / f"{PREFIX}new").is_dir()
