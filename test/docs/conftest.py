"""Helpers that read the documents: text, blocks, commands and tables of a page."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from ..viewer.conftest import bag

__all__ = ["bag"]
ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(DOCS.rglob("*.md"))]
FENCE = re.compile(r"^```(\w*)([^\n]*)\n(.*?)^```", re.M | re.S)


def text(page: Path) -> str:
    """Return the text of a page."""
    return page.read_text(encoding="utf-8")


def blocks(page: Path) -> list[tuple[str, str, str]]:
    """Return the fenced blocks of a page: language, title line and content of each."""
    return FENCE.findall(text(page))


def commands(page: Path, program: str) -> list[list[str]]:
    """Return the arguments of each call of a program in the code of a page.

    The arguments are split like those of a shell.
    """
    code = re.findall(r"(?<!`)`([^`\n]+(?:\n[^`\n]+)?)`(?!`)", FENCE.sub("", text(page)))
    lines = [line for _, _, content in blocks(page) for line in content.splitlines()]
    lines += [line for line in text(page).splitlines() if line.startswith("    ")]
    found = []
    for line in [*(c.replace("\n", " ") for c in code), *lines]:
        call = re.match(rf"(?:\$ )?\s*(?:\.venv/bin/)?{program} (.*)", line.strip())
        if call:
            words = shlex.split(call[1], comments=True)
            ends = [i for i, word in enumerate(words) if word in {"|", ">", "&", "&&", ";"}]
            found.append(words[: min(ends, default=len(words))])
    return found


def rows(page: Path, first: str) -> list[list[str]]:
    """Return the rows of the table on a page of which the first heading is `first`."""
    table = re.search(rf"^\| {first} \|.*\n\|[-:| ]+\n((?:\|.*\n)+)", text(page), re.M)
    assert table, f"{page.name}: no table of {first!r}"
    return [[c.strip() for c in line.split("|")[1:-1]] for line in table[1].splitlines()]
