"""What a killed node leaves in /dev/shm is taken away, and nothing else."""

import fcntl
import os
import time

from cam_rig.cli.shared_memory import clean

DEAD, LIVE, OLD = "fastdds_0123456789abcdef", "fastdds_port7411", "fastdds_fedcba9876543210"


def make(folder, name, age=5.0):
    path = folder / name
    path.write_bytes(b"x")
    then = time.time() - age
    os.utime(path, (then, then))
    return path


def test_only_what_is_dead_ours_and_of_this_run_goes(tmp_path):
    """A held lock, another time, another name: each stays."""
    since = time.time() - 60.0
    for name in (DEAD, DEAD + "_el", "fastdds_port7499", "sem.fastdds_port7499_mutex", "other"):
        make(tmp_path, name)
    for name in (OLD, OLD + "_el"):
        make(tmp_path, name, age=3600.0)
    make(tmp_path, "fastdds_port7500", age=0.0)  # may just be in the making
    make(tmp_path, LIVE)
    with make(tmp_path, LIVE + "_el").open("rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        removed = clean(since, tmp_path)
    assert sorted(removed) == sorted(
        [DEAD, DEAD + "_el", "fastdds_port7499", "sem.fastdds_port7499_mutex"]
    )
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"other", OLD, OLD + "_el", "fastdds_port7500", LIVE, LIVE + "_el"}


def test_without_such_a_folder_nothing_happens(tmp_path):
    """Other systems keep shared memory elsewhere."""
    assert clean(0.0, tmp_path / "none") == []
