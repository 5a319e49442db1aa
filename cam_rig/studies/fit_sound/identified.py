"""Writer of identified numbers into a YAML file that keeps comments and layout."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import yaml

from cam_rig.errors import ConfigError
from cam_rig.schema.quantity import ORIGINS

#: Replacement of a part of a text: index of its first character, index after its last, new text.
Edit = tuple[int, int, str]


def set_identified(
    path: Path, numbers: dict[tuple[str | int, ...], float], source: str, residual: str
) -> None:
    """Write numbers as `identified`, with source and residual, into a YAML file.

    Numbers with this origin are fitted to measurements. The rest of the text does not change. The
    file is replaced atomically.

    Parameters
    ----------
    path : Path
        YAML file.
    numbers : dict
        Values by key path, in the units of the file. A key path is a tuple of keys and indices.
    source, residual : str
        Source and residual of all values.

    Raises
    ------
    ConfigError
        If the file cannot be written.
    """
    text = path.read_bytes().decode("utf-8")
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    edits = {
        edit
        for keys, number in numbers.items()
        for edit in _edits(_at(root, keys), text, number, {"source": source, "residual": residual})
    }
    for start, stop, new in sorted(edits, reverse=True):
        text = text[:start] + new + text[stop:]
    part = path.with_suffix(".yaml.part")
    try:
        part.write_bytes(text.encode("utf-8"))
        os.replace(part, path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written ({error.strerror})") from None
    finally:
        part.unlink(missing_ok=True)


def _at(node: yaml.Node, keys: tuple[str | int, ...]) -> yaml.MappingNode:
    """Return the YAML mapping at a path of keys and indices below `node`."""
    for key in keys:
        node = (
            node.value[key]
            if isinstance(node, yaml.SequenceNode)
            else next(value for name, value in node.value if name.value == key)
        )
    return node


def _edits(
    node: yaml.MappingNode, text: str, number: float, texts: dict[str, str]
) -> Iterator[Edit]:
    """Yield the text edits that write one number with its source and residual.

    `node` is the YAML mapping of the number in ``text``. ``texts`` are source and residual by key.
    """
    pairs = {name.value: (name, value) for name, value in node.value}
    origin, old = next(pairs[key] for key in ORIGINS if key in pairs)
    yield *_span(origin), "identified"
    between = ", " if node.flow_style else "\n" + " " * origin.start_mark.column
    missing = [key for key in texts if key not in pairs]
    added = "".join(f"{between}{key}: {_quoted(texts[key])}" for key in missing)
    yield *_span(old), f"{number!r}{added}"
    for key in texts.keys() - missing:
        start, stop = _span(pairs[key][1])
        after = text[start:stop]
        yield start, stop, _quoted(texts[key]) + after[len(after.rstrip()) :]


def _span(node: yaml.Node) -> tuple[int, int]:
    """Return the index of the first character of a YAML node, and that after its last."""
    return node.start_mark.index, node.end_mark.index


def _quoted(text: str) -> str:
    """Return a text in double quotes, as valid in both YAML and JSON."""
    return json.dumps(text, ensure_ascii=False)
