"""Writing identified numbers back into a YAML file, keeping its comments and layout."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import yaml

from cam_rig.errors import ConfigError
from cam_rig.schema.quantity import ORIGINS

#: Where in a text (first and last character) something else is to stand, and what.
Edit = tuple[int, int, str]


def set_identified(
    path: Path, numbers: dict[tuple[str | int, ...], float], source: str, residual: str
) -> None:
    """Put numbers in as ``identified``, with source and residual; the file is replaced whole.

    Nothing else of the text changes: the numbers' own words are replaced where they stand.

    Parameters
    ----------
    numbers : key path -> number, in the unit the file already has there

    Raises
    ------
    ConfigError : the file cannot be written
    """
    text = path.read_bytes().decode("utf-8")
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    edits = {
        edit
        for keys, number in numbers.items()
        for edit in _edits(_at(root, keys), text, number, {"source": source, "residual": residual})
    }
    for begin, end, words in sorted(edits, reverse=True):
        text = text[:begin] + words + text[end:]
    part = path.with_suffix(".yaml.part")
    try:
        part.write_bytes(text.encode("utf-8"))
        os.replace(part, path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written ({error.strerror})") from None
    finally:
        part.unlink(missing_ok=True)


def _at(node: yaml.Node, keys: tuple[str | int, ...]) -> yaml.MappingNode:
    """The mapping at a key path."""
    for key in keys:
        node = (
            node.value[key]
            if isinstance(node, yaml.SequenceNode)
            else next(value for name, value in node.value if name.value == key)
        )
    return node


def _edits(
    node: yaml.MappingNode, text: str, number: float, words: dict[str, str]
) -> Iterator[Edit]:
    """What changes in the text of one number's mapping."""
    pairs = {name.value: (name, value) for name, value in node.value}
    origin, old = next(pairs[key] for key in ORIGINS if key in pairs)
    yield *_span(origin), "identified"
    between = ", " if node.flow_style else "\n" + " " * origin.start_mark.column
    missing = [key for key in words if key not in pairs]
    added = "".join(f"{between}{key}: {_quoted(words[key])}" for key in missing)
    yield *_span(old), f"{number!r}{added}"
    for key in words.keys() - missing:
        begin, end = _span(pairs[key][1])
        after = text[begin:end]
        yield begin, end, _quoted(words[key]) + after[len(after.rstrip()) :]


def _span(node: yaml.Node) -> tuple[int, int]:
    return node.start_mark.index, node.end_mark.index


def _quoted(text: str) -> str:
    """A text as YAML has it in double quotes, which is as JSON has it."""
    return json.dumps(text, ensure_ascii=False)
