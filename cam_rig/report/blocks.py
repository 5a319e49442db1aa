"""What a report is made of: sections of words, points, tables and pictures."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Words:
    """A paragraph."""

    text: str
    kind: str = "words"


@dataclass(frozen=True)
class Points:
    """A list."""

    items: tuple[str, ...]
    kind: str = "points"


@dataclass(frozen=True)
class Grid:
    """A table: caption, heads and rows of text; the first ``left`` columns are words."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    left: int = 1
    note: str = ""
    kind: str = "grid"


@dataclass(frozen=True)
class Picture:
    """A figure by its key, with what is said under it."""

    key: str
    caption: str
    kind: str = "picture"


Block = Words | Points | Grid | Picture


@dataclass(frozen=True)
class Section:
    """A titled part of the report."""

    key: str
    title: str
    blocks: tuple[Block, ...] = field(default=())
