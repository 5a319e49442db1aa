"""cam-rig --version: what is installed, told without importing it."""

import re
import subprocess
import sys
from importlib.metadata import version

from typer.testing import CliRunner

from cam_rig.cli import main as version_option
from cam_rig.cli.main import app

SCRIPT = """
import sys
from cam_rig.cli import start
sys.argv = ["cam-rig", "--version"]
try:
    start()
except SystemExit as end:
    assert not end.code
print(sorted({"rclpy", "rerun", "matplotlib", "scipy"} & set(sys.modules)))
"""


def test_a_line_for_each_part():
    """Package, viewer, and rclpy with the ROS distribution it is of."""
    result = CliRunner().invoke(app, ["--version"])
    assert result.exit_code == 0
    package, rerun, rclpy = result.stdout.splitlines()
    assert package == f"cam_rig {version('cam_rig')}"
    assert rerun == f"rerun {version('rerun-sdk')}"
    assert re.fullmatch(r"rclpy \d\S* \(ROS 2 [a-z]+\)", rclpy)


def test_nothing_heavy_is_imported():
    """Asking what is installed works where it does not, and at once."""
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=100)
    assert done.stdout.splitlines()[-1] == "[]", done.stderr


def test_what_is_missing_is_said(monkeypatch):
    """Without the extra of a library its line says so."""
    monkeypatch.setattr(version_option, "version", _nothing)
    assert set(version_option.versions().values()) == {"not installed"}


def _nothing(name):
    raise version_option.PackageNotFoundError(name)
