"""Docstrings of the package as griffe wants them.

An entry reads "name : what it is", its type standing in the signature. By the letter of numpydoc
the words after the colon would be the type; here they become the description.
"""

from __future__ import annotations

import re
from typing import Any

from griffe import Extension, Object

SECTION = re.compile(r"^(Parameters|Raises|Attributes)\n-+\n(.*?)(?=^\w+\n---|\Z)", re.M | re.S)
ENTRY = re.compile(r"^([\w*, .]+?) : (.*)$", re.M)


class Descriptions(Extension):
    """Moves the words behind an entry's colon to the line below."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Change an object's docstring before it is parsed."""
        if obj.docstring is not None:
            obj.docstring.value = SECTION.sub(_described, obj.docstring.value)


def _described(section: re.Match[str]) -> str:
    return ENTRY.sub(r"\1\n    \2", section[0])
