"""Docstrings of the package as griffe wants them.

An entry reads "name : what it is", its type standing in the signature. By the letter of numpydoc
the words after the colon would be the type; here they become the description. A field's comment of
``#:`` is its docstring.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from griffe import Docstring, Extension, Object

SECTION = re.compile(r"^(Parameters|Raises|Attributes)\n-+\n(.*?)(?=^\w+\n---|\Z)", re.M | re.S)
COMMENT = re.compile(r"#: (.*)$")
ENTRY = re.compile(r"^([\w*, .]+?) : (.*)$", re.M)


class Descriptions(Extension):
    """Moves the words behind an entry's colon to the line below."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Change an object's docstring before it is parsed; an attribute's may be its comment."""
        if obj.docstring is None and obj.is_attribute and (words := _commented(obj)):
            obj.docstring = Docstring(words, parent=obj)
        if obj.docstring is not None:
            obj.docstring.value = SECTION.sub(_described, obj.docstring.value)


def _commented(obj: Object) -> str:
    """What ``#:`` says behind an attribute, or in the lines above it."""
    if obj.lineno is None or obj.endlineno is None or not isinstance(obj.filepath, Path):
        return ""
    lines = obj.lines_collection[obj.filepath]
    if behind := COMMENT.search(lines[obj.endlineno - 1]):
        return behind[1]
    above: list[str] = []
    for line in reversed(lines[: obj.lineno - 1]):
        if not line.strip().startswith("#:"):
            break
        above.insert(0, line.strip().removeprefix("#:").strip())
    return " ".join(above)


def _described(section: re.Match[str]) -> str:
    return ENTRY.sub(r"\1\n    \2", section[0])
