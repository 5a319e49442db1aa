"""A command imports what it needs: help is there at once, and a simulation needs no scipy."""

import subprocess
import sys

import pytest

CODE = """
import sys
from cam_rig.cli.main import app
try:
    app(sys.argv[1:])
except SystemExit as ended:
    assert not ended.code
print("modules:", *sorted({module.partition(".")[0] for module in sys.modules}))
"""
ROS = {"rclpy", "rosbags", "mcap"}
FIGURES = {"matplotlib", "rerun", "jinja2", "shapely", "ezdxf"}


@pytest.mark.variants(2)
@pytest.mark.parametrize(
    ("words", "without"),
    [
        (["--help"], {"numpy", "scipy", "pydantic", "yaml"} | ROS | FIGURES),
        (["run", "--help"], {"numpy", "scipy", "yaml"} | ROS | FIGURES),
        (["simulate", "quick"], {"scipy"} | ROS | FIGURES),
    ],
)
def test_a_command_imports_what_it_needs(words, without):
    """Not the libraries of the others."""
    code = [sys.executable, "-c", CODE, *words]
    done = subprocess.run(code, capture_output=True, text=True, check=True, timeout=100)
    assert set(done.stdout.rpartition("modules:")[2].split()) & without == set()
