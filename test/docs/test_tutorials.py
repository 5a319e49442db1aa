"""Tests that the commands of a tutorial run and print the numbers on its page."""

from __future__ import annotations

import re
import runpy
import shlex
import sys
from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path

import pytest

from tools.docs.course_pictures import COURSE, SHOWN, pictures

from ..cli.conftest import call
from ..processes import ended
from .conftest import DOCS, ROOT, blocks, text

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?")


def follow(page: Path, within: float = 0.0) -> int:
    """Run the commands of a page in order, and return their number.

    The files of the page are written first. Each number in an output on the page must be printed by
    its command. ``within`` is the relative tolerance of a number. If it is not zero, the last digit
    of a decimal may also differ by one. Searches need it, because their last steps depend on the
    arithmetic of the processor.
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
            if not any(abs(float(number) - like) <= _apart(number, within) for like in there)
        }
        assert not missing, f"{name}: shown and not printed: {missing}\n{printed}"
        for file in re.findall(r"--(?:out|plot|save|json|bag) (\S+)", name):
            assert Path(file).exists(), name
        ran += 1
    return ran


def _apart(number: str, within: float) -> float:
    if not within or "." not in number:
        return within * abs(float(number))
    return max(within * abs(float(number)), 1.01 * 10.0 ** Decimal(number).as_tuple().exponent)


def steps(page: Path) -> Iterator[tuple[str, str, str]]:
    """Yield the files and commands of a page in order: kind, name or command, content.

    The content of a command is its output on the page.
    """
    for language, words, content in blocks(page):
        title = re.search(r'title="([^"]+)"', words)
        if title:
            yield "file", title[1], content
        if language == "console":
            for part in re.split(r"^\$ ", content, flags=re.M)[1:]:
                command, _, shown = part.partition("\n")
                yield "command", command, shown


def run(command: str) -> str:
    """Run a command that must succeed, and return its output.

    `cam-rig run` runs in a separate process, and other commands in this process.
    """
    program, *arguments = shlex.split(command)
    assert program == "cam-rig"
    if arguments[0] == "run":
        done = ended(sys.executable, "-m", "cam_rig.cli.main", *arguments, timeout=500)
        code, printed = done.returncode, done.stdout + done.stderr
    else:
        result = call(*arguments)
        code, printed = result.exit_code, result.output
    assert code == 0, f"{command}\n{printed}"
    return printed


#: Cases: page, smallest number of commands, relative tolerance of the numbers. The result of a
#: search depends on the arithmetic of the processor, so its tolerance is not zero.
PAGES = [("own_cam", 7, 0.0), ("campaign", 3, 0.0), ("design", 6, 1e-3), ("real_run", 3, 1e-3)]


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize(("page", "least", "within"), PAGES)
def test_every_command_of_the_page_runs(page, least, within, tmp_path, monkeypatch):
    """The commands of a tutorial run in a new folder and print its numbers.

    For the page real_run the folder contains the golden bag and the bag of the example
    simulated_bench.py. For the other pages it is empty.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200" if page == "real_run" else "100")
    if page == "real_run":
        Path("bags").mkdir()
        Path("bags/golden").symlink_to(ROOT / "bags" / "golden")
        runpy.run_path(str(ROOT / "examples" / "simulated_bench.py"), run_name="__main__")
    assert follow(DOCS / f"{page}.md", within) >= least


LESSONS = sorted((DOCS / "course").glob("[1-9]*.md"))


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("lesson", LESSONS, ids=lambda page: page.stem)
def test_every_command_of_a_lesson_runs(lesson, tmp_path, monkeypatch):
    """The commands of a lesson run in an empty folder and print its numbers."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "160")
    assert follow(lesson, 1e-3 if lesson.stem == "8_design" else 0.0) >= 1


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda page: page.stem)
def test_a_lesson_in_spanish_has_the_same_commands(lesson):
    """The Spanish edition of a lesson has the same commands, files and outputs."""
    assert blocks(lesson) == blocks(DOCS / "course" / "es" / lesson.name)


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda page: page.stem)
def test_a_lesson_shows_a_picture_that_one_of_its_commands_makes(lesson):
    """A lesson shows only pictures of its commands, each smaller than 100 kB.

    The Spanish edition shows the same pictures.
    """
    shown = pictures(lesson)
    assert shown
    assert SHOWN.findall(text(DOCS / "course" / "es" / lesson.name)) == list(shown)
    for name in shown:
        assert (ROOT / COURSE / f"{name}.png").stat().st_size < 100_000, name


@pytest.mark.ros
@pytest.mark.slow
def test_every_command_of_the_first_hour(tmp_path, ros_domain, monkeypatch):
    """The commands of first_hour.md print the numbers of the page, with ROS nodes."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    assert follow(DOCS / "first_hour.md") >= 10


def test_the_table_is_the_shipped_one():
    """The readings in own_cam.md are those of the shipped file, without its comments."""
    shown = next(text for _, words, text in blocks(DOCS / "own_cam.md") if "gl110.csv" in words)
    shipped = (ROOT / "config" / "cams" / "gunt_gl110_convex.csv").read_text(encoding="utf-8")
    lines = [line for line in shipped.splitlines() if not line.startswith("#")]
    assert shown.splitlines() == lines
