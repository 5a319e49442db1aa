"""Editions of the course from one source: for students, and for teachers.

In the source, parts for teachers are folded answers (``<details markdown="1">``) and the text
between the comments ``<!-- teacher -->`` and ``<!-- /teacher -->``.
"""

from __future__ import annotations

import re
from pathlib import Path

#: Folders of the languages below docs/, and the title of the page for teachers.
LANGUAGES = {"course": "Teacher edition", "course/es": "Edición del docente"}
#: File of the page for teachers, and of the introduction.
TEACHER, INDEX = "teacher.md", "index.md"
_ANSWERS = r'^<details markdown="1"><summary>[^\n]+</summary>\n(?P<answers>.*?)^</details>\n?'
_BLOCK = r"^<!-- teacher -->\n(?P<block>.*?)^<!-- /teacher -->\n?"
FOR_TEACHERS = re.compile(f"{_ANSWERS}|{_BLOCK}", re.M | re.S)


def student_page(page: str) -> str:
    """Return a page of the course without the parts for teachers."""
    return FOR_TEACHERS.sub("", page)


def teacher_parts(page: str) -> str:
    """Return the parts of a page that are for teachers."""
    found = FOR_TEACHERS.finditer(page)
    return "\n".join(part["answers"] or part["block"] for part in found).strip()


def teacher_page(docs: Path, folder: str) -> str:
    """Return the page for teachers: introduction, then aim and answers of each lesson."""
    parts = [f"# {LANGUAGES[folder]}", teacher_parts(_read(docs / folder / INDEX))]
    for lesson in sorted((docs / folder).glob("[1-9]*.md")):
        title, aim, *_ = _read(lesson).removeprefix("# ").split("\n\n")
        parts += [f"## [{title}]({lesson.name})", aim, teacher_parts(_read(lesson))]
    return "\n\n".join(parts) + "\n"


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8")
