"""The tutorials work: every command of a page runs, in order, and prints the numbers it shows."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from tools.docs.course_pictures import COURSE, SHOWN, pictures

from .pages import DOCS, ROOT, blocks, text
from .tutorials import follow

#: Page, how many commands it has at least, the share by which a search's number may differ: where
#: a search ends depends on the processor.
PAGES = [("own_cam", 7, 0.0), ("campaign", 3, 0.0), ("design", 6, 1e-3), ("real_run", 3, 1e-3)]


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize(("page", "least", "within"), PAGES)
def test_every_command_of_the_page_runs(page, least, within, tmp_path, monkeypatch):
    """In a folder with no more than the golden bag and, for real_run, the example's bench."""
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
    """In a folder with nothing in it; every number that the lesson shows is printed."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "160")
    assert follow(lesson, 1e-3 if lesson.stem == "8_design" else 0.0) >= 1


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda page: page.stem)
def test_a_lesson_in_spanish_has_the_same_commands(lesson):
    """And files, and numbers shown: what runs in one runs in the other."""
    assert blocks(lesson) == blocks(DOCS / "course" / "es" / lesson.name)


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda page: page.stem)
def test_a_lesson_shows_a_picture_that_one_of_its_commands_makes(lesson):
    """The same in both languages, made by ``make pictures``, small."""
    shown = pictures(lesson)
    assert shown
    assert SHOWN.findall(text(DOCS / "course" / "es" / lesson.name)) == list(shown)
    for name in shown:
        assert (ROOT / COURSE / f"{name}.png").stat().st_size < 100_000, name


@pytest.mark.ros
@pytest.mark.slow
def test_every_command_of_the_first_hour(tmp_path, ros_domain, monkeypatch):
    """The nodes of its runs are alone in a domain of their own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    assert follow(DOCS / "first_hour.md") >= 10


def test_the_table_is_the_shipped_one():
    """The readings of own_cam.md are those of config/cams, without their comment."""
    shown = next(text for _, words, text in blocks(DOCS / "own_cam.md") if "gl110.csv" in words)
    shipped = (ROOT / "config" / "cams" / "gunt_gl110_convex.csv").read_text(encoding="utf-8")
    lines = [line for line in shipped.splitlines() if not line.startswith("#")]
    assert shown.splitlines() == lines
