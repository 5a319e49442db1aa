"""Where ROS writes its log files: a node ends where it cannot."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from cam_rig.runner.resources import user_folder


def log_folder() -> tuple[Path, str]:
    """Where ROS writes log files, and what to say where that is not where it would.

    In ROS_LOG_DIR, else below ROS_HOME or ~/.ros.
    """
    own = user_folder() / "cam_rig-ros-log"
    given, home = os.environ.get("ROS_LOG_DIR"), os.environ.get("ROS_HOME")
    if not os.environ.get("HOME") and not given:  # a service, or a cron job
        return own, ""
    wanted = Path(given or Path(home or "~/.ros") / "log").expanduser()
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            return wanted, ""
    except OSError as error:
        return own, f"{wanted}: cannot be written ({error.strerror}); ROS's log files are in {own}"
