"""Hooks of mkdocs: first page, API pages, equations, and editions of the course.

README.md is the first page, and each subpackage has an API page.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import cam_rig
from tools.docs.course_editions import LANGUAGES, TEACHER, student_page, teacher_page
from tools.docs.equations import convert_equations

ROOT = Path(__file__).parents[2]
#: Subpackages whose public names are documented, in the order of the menu. Their pages follow
#: that of : `import cam_rig`.
ROOMS = (
    "laws",
    "profile",
    "dynamics",
    "acoustics",
    "simulation",
    "quantities",
    "studies",
    "bag",
    "messages",
)
#: Public names of ``import cam_rig``.
FACE = [f"cam_rig.{name}" for name in cam_rig.__all__ if not name.startswith("_")]
#: Link from a file in the root of the repository to another such file.
LINK = re.compile(r"\]\(([A-Z_]+\.md)\)")
#: True for the site for students, which does not contain the pages for teachers.
FOR_STUDENTS = os.environ.get("EDITION") == "student"
#: Pages that a search lists before others with the same words, and the factor of their rank.
BOOSTED = {"theory.md": 3.0}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Insert the API pages at the entry ``api`` of the menu."""
    config.nav = [_menu(entry) for entry in config.nav or [] if not _is_hidden(entry)]
    return config


def _menu(entry: Any) -> Any:
    """Return an entry of the menu with the API pages, and without hidden pages."""
    if entry == {"API": "api"}:
        pages = [{"cam_rig": "api/cam_rig.md"}, *({room: f"api/{room}.md"} for room in ROOMS)]
        return {"API": pages}
    ((title, content),) = entry.items()
    if isinstance(content, list):
        content = [_menu(inner) for inner in content if not _is_hidden(inner)]
    return {title: content}


def _is_hidden(entry: dict[str, Any]) -> bool:
    """Return True for a page for teachers in the edition for students."""
    (content,) = entry.values()
    return FOR_STUDENTS and isinstance(content, str) and content.endswith(f"/{TEACHER}")


def _page_of(name: str) -> str:
    """Return the page of a file in the root. README.md is the first page."""
    return "index.md" if name == "README.md" else name.lower()


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Generate the pages of the files in the root, of the teachers and of the API."""
    pages = {}
    for source in ROOT.glob("*.md"):
        text = source.read_text(encoding="utf-8").replace("](docs/", "](")
        pages[_page_of(source.name)] = LINK.sub(lambda name: f"]({_page_of(name[1])})", text)
    pages["api/cam_rig.md"] = "# cam_rig\n\n" + "\n".join(f"::: {name}" for name in FACE)
    for room in ROOMS:
        pages[f"api/{room}.md"] = f"# cam_rig.{room}\n\n::: cam_rig.{room}\n"
    for folder in () if FOR_STUDENTS else LANGUAGES:
        pages[f"{folder}/{TEACHER}"] = teacher_page(ROOT / "docs", folder)
    for path, text in pages.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Convert the equations of a page, and remove the parts for teachers.

    Thus no page of the site loads an external library.
    """
    path = page.file.src_uri
    if boost := BOOSTED.get(path):
        page.meta["search"] = {"boost": boost}
    return convert_equations(student_page(markdown) if path.startswith("course/") else markdown)
