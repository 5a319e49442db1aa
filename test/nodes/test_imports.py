"""What a node imports before it is a node: nothing that it does not need, as five of them wait."""

import json
import subprocess
import sys

import pytest

#: Libraries of the commands, the figures and the viewer, and scipy, which few scenes need.
NEVER = {"scipy", "matplotlib", "typer", "rich", "jinja2", "rerun", "pyarrow", "shapely", "ezdxf"}
#: Those of bags and of the messages made by the thousand, for who writes them.
OF_BAGS = {"mcap", "rosbags", "zstandard"}
NODES = {
    "cam_drive": NEVER | OF_BAGS,
    "microphone": NEVER | OF_BAGS,
    "follower": NEVER | {"mcap"},
    "law_server": NEVER | {"mcap"},
    "recorder": NEVER,
}
CODE = """
import json, sys
import cam_rig.nodes.{name}, cam_rig.nodes.process
print(json.dumps(sorted(set(module.partition(".")[0] for module in sys.modules))))
"""


@pytest.mark.variants(2)
@pytest.mark.parametrize("name", NODES)
def test_a_node_imports_what_it_needs(name):
    """Started by `ros2 run`, a launch file or the runner."""
    code = [sys.executable, "-c", CODE.format(name=name)]
    done = subprocess.run(code, capture_output=True, text=True, check=True, timeout=100)
    assert set(json.loads(done.stdout)) & NODES[name] == set()
