"""Docstrings of the package in the form that griffe requires.

An entry reads "name : description", and its type is in the signature. In strict numpydoc the
text after the colon would be the type. Here it becomes the description. A field's comment of
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
    """Extension that moves the text after an entry's colon to the line below."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Change an object's docstring before it is parsed.

        The docstring of an attribute may be its comment.
        """
        if obj.docstring is None and obj.is_attribute and (comment := _comment(obj)):
            obj.docstring = Docstring(comment, parent=obj)
        if obj.docstring is not None:
            obj.docstring.value = SECTION.sub(_indent_descriptions, obj.docstring.value)


def _comment(obj: Object) -> str:
    """Return the ``#:`` comment after an attribute, or in the lines above it."""
    if obj.lineno is None or obj.endlineno is None or not isinstance(obj.filepath, Path):
        return ""
    lines = obj.lines_collection[obj.filepath]
    if after := COMMENT.search(lines[obj.endlineno - 1]):
        return after[1]
    above: list[str] = []
    for line in reversed(lines[: obj.lineno - 1]):
        if not line.strip().startswith("#:"):
            break
        above.insert(0, line.strip().removeprefix("#:").strip())
    return " ".join(above)


def _indent_descriptions(section: re.Match[str]) -> str:
    return ENTRY.sub(r"\1\n    \2", section[0])
