"""Tests of the ros2 commands in the documents, on a running rig.

The pages are docs/nodes.md, interfaces.md and panel.md. The real command line is not installed with
the libraries of the tests. Each command is parsed from its page: `ros2 run` starts the executable,
and a client performs the others with the same name, type and content.
"""

import os
import re
import shlex
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
import yaml
from std_srvs.srv import Trigger

from cam_rig.bag.files import is_unclosed

from .conftest import wait_until

pytestmark = pytest.mark.ros
DOCS = Path(__file__).parents[2] / "docs"
#: Parts of commands for other packages' interfaces. Commands with these words are not tested.
FOREIGN = ("simulation_interfaces", "cam_velocity")


def commands_of(page, start):
    """Return the commands of a page that start with some words, without these words.

    A command is a list of words.
    """
    found = re.findall(rf"(?:^    |`){start} ([^`\n]*)", (DOCS / page).read_text("utf-8"), re.M)
    lines = [line.partition(" # ")[0].removesuffix(" &") for line in found]
    return [shlex.split(line) for line in lines if not any(name in line for name in FOREIGN)]


def test_the_nodes_of_the_page_run_a_scene(domain, tmp_path):
    """The commands of the page that start the nodes one by one run a scene.

    The bag is closed at the end. The scene is `quick` instead of the default, which takes longer.
    """
    os.symlink(DOCS.parent / "config", tmp_path / "config")
    starts = commands_of("nodes.md", "ros2 run cam_rig")[:5]
    assert [name for name, *_ in starts][-1] == "cam_drive"
    programs = []
    for name, *arguments in starts:
        options = [*(arguments or ["--ros-args"]), "-p", "scene:=quick"]
        executable = Path(sys.executable).parent / name
        programs.append(subprocess.Popen([executable, *options], cwd=tmp_path))
    try:
        wait_until(lambda: all(program.poll() is not None for program in programs))
    finally:
        for program in programs:
            program.kill()
    assert [program.returncode for program in programs] == [0] * 5
    assert not is_unclosed(tmp_path / "bags" / "mine")


def test_the_operator_commands_of_the_pages_are_accepted(start_rig):
    """Each service call, message and parameter of the pages is accepted by the rig."""
    rig = start_rig("tm21_sweep", autostart=False)  # long enough not to end before the checks
    pages = ("nodes.md", "interfaces.md", "panel.md")
    services = {tuple(words) for page in pages for words in commands_of(page, "ros2 service call")}
    assert len(services) == 4
    for service, kind in sorted(services):
        assert kind == "std_srvs/srv/Trigger"
        client = rig.node.create_client(Trigger, service)
        rig.wait_for(client.service_is_ready)
    values = [words for page in pages for words in commands_of(page, "ros2 param set")]
    assert len(values) > 5
    for node, name, text in values:
        rig.set_parameter(node.strip("/"), name, yaml.safe_load(text))
    published = [words for page in pages for words in commands_of(page, "ros2 topic pub --once")]
    assert len(published) == 2
    for topic, kind, text in published:
        package, _, name = kind.split("/")
        message = getattr(import_module(f"{package}.msg"), name)(**yaml.safe_load(text))
        rig.publish(topic, message)
    rig.wait_for(
        lambda: (
            rig.get_parameter("cam_drive", "rpm") == pytest.approx(31.4 * 30 / 3.14159, rel=1e-4)
        )
    )
