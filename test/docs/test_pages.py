"""Tests that the documents refer only to existing files, commands and code."""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import markdown
import matplotlib as mpl
import pytest

from cam_rig.cli.main import COMMANDS, command
from tools.docs.commands import PAGE, page
from tools.docs.course_editions import LANGUAGES, student_page, teacher_page, teacher_parts
from tools.docs.drawings import DRAWINGS
from tools.docs.equations import CODE, EQUATION, convert_equations, line

from ..processes import ended
from .conftest import DOCS, PAGES, ROOT, blocks, commands, text

#: Pattern of the path of a file or folder in this repository.
TREE = r"(?:cam_rig|config|test|tools|benchmark|examples|launch|docs|bags)/[\w./*-]*\w/?"
#: Pattern of paths on a page that need not exist: placeholders, and files that a run writes.
ANY = re.compile(r"NAME|mine|^bags/(?!golden|README)")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_a_page_names_exist(page):
    """Each relative link and each path of this repository on a page leads to a file."""
    links = re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]*`", "", text(page)))
    for link in links:
        if not link.startswith(("http:", "https:", "#")):
            assert (page.parent / link.partition("#")[0]).is_file(), f"{page.name}: {link}"
    named = set(re.findall(rf"`({TREE})`", text(page)))
    assert not [p for p in named if not ANY.search(p) and not list(ROOT.glob(p.rstrip("/")))]


def test_short_names_in_the_lists_exist():
    """A file that a list of architecture.md gives without a folder exists.

    Its folder is that of the previous path in the same list item.
    """
    for cell in re.findall(r"^(?:-|\d+\.) (.*)", text(DOCS / "architecture.md"), re.M):
        folder = None
        for name in re.findall(r"`([\w./*]+)`", cell):
            if name.startswith("cam_rig/"):
                path = ROOT / name
                folder = path if path.is_dir() else path.parent
            elif folder is not None and name.endswith(".py"):
                assert list(folder.glob(name)), f"{name} in {folder}"


def test_every_picture_is_shown():
    """Each picture in docs/ is used on a page."""
    words = "".join(text(page) for page in PAGES)
    for picture in (p for kind in ("png", "svg", "webp") for p in DOCS.rglob(f"*.{kind}")):
        assert picture.name in words


def test_the_readme_is_short():
    """README.md has at most 80 lines, about two screens."""
    assert len(text(ROOT / "README.md").splitlines()) <= 80


def test_list_of_rooms_is_whole():
    """The list in architecture.md contains each subpackage of cam_rig, and no other."""
    page = text(DOCS / "architecture.md")
    named = set(re.findall(r"^- `cam_rig/(\w+)`:", page, re.M))
    folders = {p.parent.name for p in (ROOT / "cam_rig").glob("*/__init__.py")}
    assert named == folders


# -- every command, option, make target and node in the documents exists


VERBS = {name: command(name) for name in COMMANDS}


def test_the_page_of_commands_is_that_of_today():
    """The page of commands equals the page that is generated from the texts of --help.

    `make docs` generates the page again.
    """
    assert text(PAGE) == page()


@pytest.mark.parametrize("document", PAGES, ids=[page.name for page in PAGES])
def test_commands_of_a_page_exist(document):
    """Each command on a page exists, with its options.

    The same applies to each make target, node, launch file, script and extra.
    """
    for verb, *arguments in commands(document, "cam-rig"):
        if not verb.isupper():
            assert verb in VERBS, verb
            if arguments and "[OPTIONS]" not in arguments:
                VERBS[verb].make_context(verb, list(arguments))
    makefile, setup = text(ROOT / "Makefile"), text(ROOT / "setup.py")
    for target, *_ in commands(document, "make"):
        assert re.search(rf"^{target}:", makefile, re.M), target
    for package, name, *_ in commands(document, "ros2 run"):
        assert package != "cam_rig" or re.search(rf'"{name}( =|")', setup), name
    for _, name, *_ in commands(document, "ros2 launch"):
        assert (ROOT / "launch" / name).is_file(), name
    for path in re.findall(r"python ((?:tools|benchmark)/[\w/]+\.py)", text(document)):
        assert (ROOT / path).is_file(), path
    for extra in re.findall(r"cam_rig\[([\w-]+)\]", text(document)):
        assert f'"{extra}": ' in setup, extra


# -- the Python code of the documents runs without changes


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", DOCS / "python.md", DOCS / "bounce.md"], ids=lambda p: p.name
)
def test_blocks_run_one_after_the_other(page, monkeypatch):
    """The Python blocks of a page run in order in one namespace without an error.

    They run in the root of the repository. Their assertions check the numbers on the page.
    """
    monkeypatch.chdir(ROOT)
    code = [content for language, _, content in blocks(page) if language == "python"]
    assert code
    names = {}
    for block in code:
        exec(compile(block, page.name, "exec"), names)


# -- the drawings of the theory pages equal the output of their script


def outline(path):
    """Return an SVG with numbers rounded to 0.1, because last digits vary by machine."""
    svg = path.read_text(encoding="utf-8")
    return re.sub(r"-?\d+\.\d+", lambda number: f"{float(number[0]):.1f}", svg)


@pytest.mark.parametrize("name", DRAWINGS)
def test_drawing_is_that_of_today(name, tmp_path):
    """Each drawing in docs/ equals the output of its script, to 0.1 of a unit.

    `make docs` draws it again.
    """
    (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context({"svg.hashsalt": "cam_rig"}):
        DRAWINGS[name](tmp_path / name)
    assert outline(tmp_path / name) == outline(DOCS / name)


# -- the documents as a web site: complete, and without files of other hosts


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Folder of the web site, built by mkdocs without a warning."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-d", folder]
    done = ended(*command, cwd=ROOT, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}, timeout=500)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.mark.long
def test_every_page_is_in_the_menu(site):
    """The menu of the first page of the site links to each document.

    The site also has the pages of the API and the index of the search.
    """
    menu = (site / "index.html").read_text(encoding="utf-8")
    for one in DOCS.rglob("*.md"):
        assert f'href="{one.relative_to(DOCS).with_suffix(".html")}"' in menu, one.name
    assert (site / "api" / "cam_rig.html").is_file()
    assert (site / "search" / "search_index.js").is_file()


@pytest.mark.long
def test_a_search_for_the_jump_speed_finds_its_page(site):
    """A search for "Jump speed" lists the section of the theory page first."""
    text_of_index = (site / "search" / "search_index.js").read_text(encoding="utf-8")
    index = json.loads(text_of_index.removeprefix("var __index = ").rstrip(";"))
    boosts = {entry["location"]: entry.get("boost", 1) for entry in index["docs"]}
    titles = {entry["location"] for entry in index["docs"] if entry["title"] == "Jump speed"}
    assert max(titles, key=boosts.__getitem__) == "theory.html#jump-speed"


@pytest.mark.long
def test_nothing_comes_from_another_machine(site):
    """No page of the site loads a script, style, font or picture from another host."""
    sources = r"<(?:script|img|iframe|source)[^>]*\ssrc=[\"']?(?:https?:)?//"
    sheets = r"<link[^>]*rel=[\"']?(?:stylesheet|preconnect|preload)[^>]*(?:https?:)?//"
    loaded = re.compile(f"{sources}|{sheets}")
    for one in site.rglob("*.html"):
        found = loaded.search(one.read_text(encoding="utf-8"))
        assert found is None, f"{one.name}: {found[0]}"
    for style in site.rglob("*.css"):
        assert not re.search(r"(?:url\(|@import )[\"']?https?:", style.read_text(encoding="utf-8"))


# -- the course: lessons without answers for students, and a page with answers for teachers

COURSES = sorted(DOCS.joinpath(folder) for folder in LANGUAGES)


@pytest.mark.parametrize("course", COURSES, ids=lambda folder: folder.name)
def test_the_editions_of_the_course(course):
    """Each lesson has answers, which only the page of the teacher contains.

    The answers and the page of the student together are the whole source of the lesson.
    """
    teacher = teacher_page(DOCS, str(course.relative_to(DOCS)))
    lessons = sorted(course.glob("[1-9]*.md"))
    assert len(lessons) == 9
    for source in [*lessons, course / "index.md"]:
        parts, student = teacher_parts(text(source)), student_page(text(source))
        assert len(parts) > 500 and parts in teacher, source.name
        assert not set(parts.splitlines()) & set(student.splitlines()) - {""}
        assert "teacher -->" not in student and "<details" not in student
        assert len(student) + len(parts) == pytest.approx(len(text(source)), abs=100)


@pytest.mark.long
def test_answers_are_on_the_teachers_page_alone(site):
    """An answer of lesson 1, 1.44 m/s, is only on the page of the teacher."""
    pages = {
        path.name: path.read_text(encoding="utf-8")
        for path in (site / "course").glob("*.html")
        if "1.44 m/s" in path.read_text(encoding="utf-8")
    }
    assert list(pages) == ["teacher.html"]


# -- the TeX of each page is converted to MathML without remains


def equations(page: Path) -> list[str]:
    """Return the TeX of each equation of a page, without the dollar signs."""
    parts = CODE.split(text(page))[::2]
    return [one[1] or one[2] for part in parts for one in EQUATION.finditer(part)]


WITH_EQUATIONS = [page for page in sorted(DOCS.rglob("*.md")) if equations(page)]


@pytest.mark.parametrize("page", WITH_EQUATIONS, ids=lambda page: str(page.relative_to(DOCS)))
def test_every_equation_of_a_page_is_drawn(page: Path) -> None:
    """Each equation of a page becomes well-formed MathML without remains of TeX.

    Code on the page is not changed.
    """
    shown = convert_equations(text(page))
    assert shown.count("<math") >= len(equations(page)) > 0
    assert CODE.findall(shown) == CODE.findall(text(page))
    for part in shown.split("<math")[1:]:
        equation = "<math" + part.partition("</math>")[0] + "</math>"
        ElementTree.fromstring(equation)
        assert not set(equation) & set("\\{}$"), equation


def test_an_inline_equation_stays_in_its_paragraph() -> None:
    """An equation at the start of a line remains in the paragraph around it.

    Markdown would otherwise start a new block at the element <math>.
    """
    page = convert_equations("The speed is\n$v = 2 s$, in m/s.")
    html = markdown.markdown(page, extensions=["md_in_html"])
    assert html.count("<p>") == 1 and html.endswith("in m/s.</p>")


def test_the_line_of_an_equation() -> None:
    """TeX is converted to a line of text for the report, and unknown TeX is an error.

    The cases are fractions, roots, subscripts, dots and primes.
    """
    assert line(r"\frac{a}{b_2} + \frac1b") == "(a)/(b _ 2) + 1/b"
    assert line(r"\sqrt{2 x}\,\ddot x = k_{stem} s''") == "√(2 x) x\u0308 = k _ (stem) s″"
    with pytest.raises(KeyError):
        line(r"\unknown")
