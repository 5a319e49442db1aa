"""Start of a command: interrupts, environment, imported libraries."""

import os
import re
import sys
from importlib.metadata import PackageNotFoundError, version
from unittest.mock import MagicMock

import pytest

from cam_rig.cli.main import versions
from cam_rig.errors import INTERRUPTED, ConfigError
from cam_rig.extras import LAST_SECOND, source_date

from ..processes import ended
from .conftest import BIN, call


def test_interrupt_during_imports_is_one_line():
    """A SIGINT while a command imports its modules ends it with one line."""
    code = (
        "import signal, sys\n"
        "class Interrupt:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'cam_rig.studies.simulate.command':\n"
        "            signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupt())\n"
        "from cam_rig.cli import start\n"
        "start()"
    )
    done = ended(sys.executable, "-c", code, "simulate")
    assert (done.returncode, done.stderr) == (INTERRUPTED, "cam-rig: interrupted by SIGINT\n")


@pytest.mark.variants(1)
@pytest.mark.parametrize("program", ["cam-rig jump poly345", "cam-rig report quick", "law_server"])
def test_invalid_date_is_one_line(program, tmp_path):
    """An invalid SOURCE_DATE_EPOCH ends a command with one line that has the remedy.

    Libraries that read it would raise a traceback.
    """
    name, *words = program.split()
    environment = os.environ | {"SOURCE_DATE_EPOCH": "abc"}
    done = ended(BIN / name, *words, env=environment, cwd=tmp_path)
    assert done.returncode == ConfigError.exit_code
    (line,) = done.stderr.splitlines()
    assert line.partition(": ")[2] == (
        "SOURCE_DATE_EPOCH: 'abc' is not a date; allowed: whole seconds since 1970, as `date +%s` "
        "prints; or unset it"
    )
    assert list(tmp_path.iterdir()) == []


def test_source_date(monkeypatch):
    """`source_date` returns the seconds of SOURCE_DATE_EPOCH, or None without it.

    Any other text than whole seconds raises ConfigError.
    """
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    assert source_date() is None
    for seconds in (0, 1_700_000_000, LAST_SECOND):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", str(seconds))
        assert source_date() == seconds
    for wrong in ("today", "", "1e9", "-1", str(LAST_SECOND + 1), "9" * 30):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", wrong)
        with pytest.raises(ConfigError, match=r"^SOURCE_DATE_EPOCH: .* is not a date; allowed: "):
            source_date()


CODE = """
import sys
from cam_rig.cli import start
try:
    start()
except SystemExit as ended:
    assert not ended.code
print("modules:", *sorted({module.partition(".")[0] for module in sys.modules}))
"""
ROS = {"rclpy", "rosbags", "mcap"}
FIGURES = {"matplotlib", "rerun", "jinja2", "shapely", "ezdxf"}


@pytest.mark.variants(3)
@pytest.mark.parametrize(
    ("words", "without"),
    [
        (["--version"], {"rclpy", "rerun", "matplotlib", "scipy"}),
        (["--help"], {"numpy", "scipy", "pydantic", "yaml"} | ROS | FIGURES),
        (["run", "--help"], {"numpy", "scipy", "yaml"} | ROS | FIGURES),
        (["simulate", "quick"], {"scipy"} | ROS | FIGURES),
    ],
)
def test_command_does_not_import_unused_libraries(words, without):
    """A command does not import large libraries that it does not use.

    The imports would delay its start.
    """
    done = ended(sys.executable, "-c", CODE, *words)
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.rpartition("modules:")[2].split()) & without == set()


def test_version_has_a_line_for_each_package():
    """--version prints the versions of cam_rig, Rerun and rclpy with its distribution."""
    package, rerun, rclpy = call("--version").stdout.splitlines()
    assert package == f"cam_rig {version('cam_rig')}" and rerun == f"rerun {version('rerun-sdk')}"
    assert re.fullmatch(r"rclpy \d\S* \(ROS 2 [a-z]+\)", rclpy)


def test_version_reports_missing_packages(monkeypatch):
    """--version reports packages that are not installed."""
    monkeypatch.setattr("importlib.metadata.version", MagicMock(side_effect=PackageNotFoundError))
    assert set(versions().values()) == {"not installed"}


def test_closed_stdout_or_removed_folder_gives_no_traceback(tmp_path):
    """A command with closed stdout prints no traceback.

    In a removed working folder it ends with one line that has the remedy.
    """
    code = "from cam_rig.cli import start; start()"
    command = f"{sys.executable} -c '{code}' laws"
    assert "Traceback" not in ended("sh", "-c", f"{command} >&-").stderr
    gone = ended("sh", "-c", f"mkdir gone && cd gone && rmdir ../gone && {command}", cwd=tmp_path)
    words = "cam-rig: the working folder has been removed; change to another\n"
    assert (gone.returncode, gone.stderr) == (1, words)
