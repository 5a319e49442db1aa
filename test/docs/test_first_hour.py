"""The tutorial works: every command of docs/first_hour.md runs, and gives the numbers it shows."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from .pages import DOCS, blocks

PAGE = DOCS / "first_hour.md"
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?")


def steps():
    """Files to write and commands to run, in the order of the page: kind, name, content."""
    for language, words, content in blocks(PAGE):
        title = re.search(r'title="([^"]+)"', words)
        if title:
            yield "file", title[1], content
        if language == "console":
            for part in re.split(r"^\$ ", content, flags=re.M)[1:]:
                command, _, shown = part.partition("\n")
                yield "command", command, shown


@pytest.mark.ros
@pytest.mark.slow
def test_every_command_of_the_first_hour(tmp_path, ros_domain):
    """In an empty folder, one after the other; every number shown is in what is printed."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "COLUMNS": "120", "ROS_DOMAIN_ID": str(ros_domain)}
    ran = 0
    for kind, name, content in steps():
        if kind == "file":
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(content, encoding="utf-8")
            continue
        shell = {"shell": True, "cwd": tmp_path, "env": environment}
        done = subprocess.run(name, check=False, capture_output=True, text=True, **shell)
        printed = done.stdout + done.stderr
        assert done.returncode == 0, f"{name}\n{printed}"
        missing = set(NUMBER.findall(content)) - set(NUMBER.findall(printed))
        assert not missing, f"{name}: shown and not printed: {missing}\n{printed}"
        for file in re.findall(r"--(?:out|plot|save|json|bag) (\S+)", name):
            assert (tmp_path / file).exists(), name
        ran += 1
    assert ran >= 10
