"""Two runs in one ROS domain would hear each other: the second is refused."""

import pytest

from cam_rig.cli.domain import own_domain
from cam_rig.errors import OutputError, RunError


def test_a_domain_is_held_once(monkeypatch, tmp_path):
    """The second run is told which domain is taken; another domain, or a later run, is free."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    with own_domain():
        with pytest.raises(RunError, match="another run is at work in ROS domain 7"), own_domain():
            pass
        monkeypatch.setenv("ROS_DOMAIN_ID", "8")
        with own_domain():
            pass
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    with own_domain():
        pass


def test_without_room_for_a_lock_the_way_out_is_named(monkeypatch, tmp_path):
    """A disk that is full: one line, no traceback."""
    (tmp_path / "file").touch()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "file"))
    with pytest.raises(OutputError, match="name a folder with room in TMPDIR"), own_domain():
        pass
