"""The tutorial works: every command of docs/first_hour.md runs, and gives the numbers it shows."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cam_rig.cli.main import app

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
def test_every_command_of_the_first_hour(tmp_path, ros_domain, monkeypatch):
    """In an empty folder, one after the other; every number shown is in what is printed."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    ran = 0
    for kind, name, content in steps():
        if kind == "file":
            Path(name).parent.mkdir(parents=True, exist_ok=True)
            Path(name).write_text(content, encoding="utf-8")
            continue
        printed = run(name)
        missing = set(NUMBER.findall(content)) - set(NUMBER.findall(printed))
        assert not missing, f"{name}: shown and not printed: {missing}\n{printed}"
        for file in re.findall(r"--(?:out|plot|save|json|bag) (\S+)", name):
            assert Path(file).exists(), name
        ran += 1
    assert ran >= 10


def run(command):
    """What a command prints; a run of nodes in a process of its own, the others in this one."""
    program, *arguments = shlex.split(command)
    assert program == "cam-rig"
    if arguments[0] == "run":
        call = [sys.executable, "-m", "cam_rig.cli.main", *arguments]
        done = subprocess.run(call, capture_output=True, text=True, check=False)
        code, printed = done.returncode, done.stdout + done.stderr
    else:
        result = CliRunner().invoke(app, arguments)
        code, printed = result.exit_code, result.output
    assert code == 0, f"{command}\n{printed}"
    return printed
