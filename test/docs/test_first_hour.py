"""The tutorial works: every command of docs/first_hour.md runs, and gives the numbers it shows."""

from __future__ import annotations

import pytest

from .pages import DOCS
from .tutorials import follow


@pytest.mark.ros
@pytest.mark.slow
def test_every_command_of_the_first_hour(tmp_path, ros_domain, monkeypatch):
    """In an empty folder, one after the other; every number shown is in what is printed."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    assert follow(DOCS / "first_hour.md") >= 10
