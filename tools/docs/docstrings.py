"""Extension of the API pages: a ``#:`` comment of a field becomes its docstring."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from griffe import Docstring, Extension, Object

COMMENT = re.compile(r"#: (.*)$")


class FieldComments(Extension):
    """Extension that uses the comment of a field as its docstring."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Set the comment of an attribute without a docstring as its docstring."""
        if obj.docstring is None and obj.is_attribute and (comment := _comment(obj)):
            obj.docstring = Docstring(comment, parent=obj)


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
