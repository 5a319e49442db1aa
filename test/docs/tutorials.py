"""Tutorials as tests follow them: files to write, commands to run, numbers that they show."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from typer.testing import CliRunner

from cam_rig.cli.main import app

from .pages import blocks

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?")


def follow(page: Path, within: float = 0.0) -> int:
    """Do what a page says, in this folder; every number shown is printed. How many commands ran.

    ``within`` is the share of a number that its like may differ by, where a search ends within a
    bound and the last steps to it depend on the processor's arithmetic.
    """
    ran = 0
    for kind, name, content in steps(page):
        if kind == "file":
            Path(name).parent.mkdir(parents=True, exist_ok=True)
            Path(name).write_text(content, encoding="utf-8")
            continue
        printed = run(name)
        there = [float(number) for number in NUMBER.findall(printed)]
        missing = {
            number
            for number in NUMBER.findall(content)
            if not any(abs(float(number) - like) <= within * abs(like) for like in there)
        }
        assert not missing, f"{name}: shown and not printed: {missing}\n{printed}"
        for file in re.findall(r"--(?:out|plot|save|json|bag) (\S+)", name):
            assert Path(file).exists(), name
        ran += 1
    return ran


def steps(page: Path) -> Iterator[tuple[str, str, str]]:
    """Files to write and commands to run, in the order of the page: kind, name, content."""
    for language, words, content in blocks(page):
        title = re.search(r'title="([^"]+)"', words)
        if title:
            yield "file", title[1], content
        if language == "console":
            for part in re.split(r"^\$ ", content, flags=re.M)[1:]:
                command, _, shown = part.partition("\n")
                yield "command", command, shown


def run(command: str) -> str:
    """What a command prints; a run of nodes in a process of its own, the others in this one."""
    program, *arguments = shlex.split(command)
    assert program == "cam-rig"
    if arguments[0] == "run":
        call = [sys.executable, "-m", "cam_rig.cli.main", *arguments]
        done = subprocess.run(call, capture_output=True, text=True, check=False, timeout=500)
        code, printed = done.returncode, done.stdout + done.stderr
    else:
        result = CliRunner().invoke(app, arguments)
        code, printed = result.exit_code, result.output
    assert code == 0, f"{command}\n{printed}"
    return printed
