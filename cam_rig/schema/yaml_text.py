"""YAML 1.2 from anybody: numbers, texts, lists and mappings, within limits, in linear time.

libyaml cuts the text into events, and values are made of them here one by one, so nothing in it can
recurse, run code or grow beyond what was read. A text that looks like a date stays a text.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import yaml

from cam_rig.errors import ConfigError

#: Levels of lists and mappings within each other.
MAX_DEPTH = 32
#: Characters of a number.
MAX_DIGITS = 300
#: Values in all, those that aliases repeat included.
MAX_VALUES = 1_000_000
#: Without libyaml the same, but slower.
LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
Value = Any
WORDS: dict[str, Value] = {"": None, "~": None}
WORDS |= dict.fromkeys(("null", "Null", "NULL"))
WORDS |= dict.fromkeys(("true", "True", "TRUE"), True)
WORDS |= dict.fromkeys(("false", "False", "FALSE"), False)
NUMBERS: tuple[tuple[re.Pattern[str], Callable[[str], int | float]], ...] = (
    (re.compile(r"[-+]?[0-9][0-9_]*"), int),
    (re.compile(r"[-+]?0b[01_]*[01][01_]*"), lambda text: int(text, 2)),
    (re.compile(r"[-+]?0o[0-7_]*[0-7][0-7_]*"), lambda text: int(text, 8)),
    (re.compile(r"[-+]?0x[0-9a-fA-F_]*[0-9a-fA-F][0-9a-fA-F_]*"), lambda text: int(text, 16)),
    (re.compile(r"[-+]?(?:[0-9][0-9_]*\.?[0-9_]*|\.[0-9][0-9_]*)(?:[eE][-+]?[0-9]+)?"), float),
    (
        re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"),
        lambda text: float(text.replace(".", "")),
    ),
)
#: What a number begins with.
DIGITS = frozenset("-+.0123456789")
TAG = "tag:yaml.org,2002:"
#: The tags that may be written out, and what is then allowed.
TAGS: dict[str, tuple[type, ...]] = {
    "int": (int,),
    "float": (int, float),
    "bool": (bool,),
    "null": (type(None),),
    "map": (dict,),
    "seq": (list,),
}
MERGE, NO_KEY = object(), object()


def parse_yaml(text: str) -> Value:
    """The one document of a text; None where it has none."""
    builder = _Builder()
    try:
        for event in yaml.parse(text, Loader=LOADER):
            builder.take(event)
    except yaml.YAMLError as error:
        words = " ".join(str(error).split()).replace('in "<unicode string>", ', "at ")
        raise ConfigError(f"not YAML: {words}") from None
    return builder.document


@dataclass
class _Open:
    """A list or a mapping that is not at its end."""

    value: Value
    anchor: str | None
    line: int
    before: int
    height: int = 1
    key: Value = NO_KEY
    merged: list[dict[Value, Value]] = field(default_factory=list)


class _Builder:
    """Values from events; ``document`` at the end."""

    def __init__(self) -> None:
        self.document: Value = None
        self._documents, self._values = 0, 0
        self._open: list[_Open] = []
        self._anchors: dict[str, tuple[Value, int, int]] = {}

    def take(self, event: Any) -> None:
        """Go on by an event."""
        line = event.start_mark.line + 1
        match event:
            case yaml.ScalarEvent():
                self._count(1, line)
                value = _scalar(event, line)
                self._remember(event.anchor, value, 1, 0)
                into = self._open[-1] if self._open else None
                wants_key = into is not None and into.key is NO_KEY and isinstance(into.value, dict)
                merges = wants_key and value == "<<" and event.implicit[0]
                self._put(MERGE if merges else value, line)
            case yaml.SequenceStartEvent() | yaml.MappingStartEvent():
                self._begin(event, line)
            case yaml.SequenceEndEvent() | yaml.MappingEndEvent():
                self._end()
            case yaml.AliasEvent():
                if event.anchor not in self._anchors:
                    raise _wrong(line, f"*{event.anchor} is not there, or not at its end")
                value, size, height = self._anchors[event.anchor]
                self._count(size, line)
                self._put(value, line, height)
            case yaml.DocumentStartEvent():
                self._documents += 1
                if self._documents > 1:
                    raise _wrong(line, "a second document begins; allowed: one")

    def _begin(self, event: Any, line: int) -> None:
        _require_depth(len(self._open) + 1, line)
        value: Value = {} if isinstance(event, yaml.MappingStartEvent) else []
        _require_tag(event.tag, value, line)
        self._anchors.pop(event.anchor, None)  # until its end it cannot be meant
        self._open.append(_Open(value, event.anchor, line, self._values))
        self._count(1, line)

    def _end(self) -> None:
        closed = self._open.pop()
        for merged in closed.merged:
            for key, value in merged.items():
                closed.value.setdefault(key, value)
        self._remember(closed.anchor, closed.value, self._values - closed.before, closed.height)
        self._put(closed.value, closed.line, closed.height)

    def _put(self, value: Value, line: int, height: int = 0) -> None:
        """Into the list or mapping that is open, or as the document; of so many levels."""
        if not self._open:
            self.document = value
            return
        into = self._open[-1]
        into.height = max(into.height, height + 1)
        _require_depth(len(self._open) + height, line)
        if isinstance(into.value, list):
            into.value.append(value)
        elif into.key is NO_KEY:
            into.key = _key(value, into.value, line)
        else:
            if into.key is MERGE:
                into.merged += value if isinstance(value, list) else [value]
                if not all(isinstance(one, dict) for one in into.merged):
                    raise _wrong(line, "<< merges mappings alone")
            else:
                into.value[into.key] = value
            into.key = NO_KEY

    def _remember(self, anchor: str | None, value: Value, size: int, height: int) -> None:
        if anchor is not None:
            self._anchors[anchor] = (value, size, height)

    def _count(self, values: int, line: int) -> None:
        self._values += values
        if self._values > MAX_VALUES:
            raise _wrong(line, f"has more than {MAX_VALUES} values, counting those of aliases")


def _key(value: Value, mapping: dict[Value, Value], line: int) -> Value:
    if isinstance(value, (list, dict)):
        raise _wrong(line, "a list or a mapping is a key; allowed: a text")
    if value is not MERGE and value in mapping:
        raise _wrong(line, f"the key {str(value)[:40]!r} is there twice")
    return value


def _scalar(event: Any, line: int) -> Value:
    """Text, number, truth or nothing; the plain style alone makes more than a text."""
    if event.tag == f"{TAG}str" or (event.tag is None and not event.implicit[0]):
        return event.value
    value = _plain(event.value, line)
    _require_tag(event.tag, value, line)
    return value


def _plain(text: str, line: int) -> Value:
    if text in WORDS:
        return WORDS[text]
    if text[0] not in DIGITS:
        return text
    if len(text) > MAX_DIGITS:
        if text.strip("-+.0123456789_abcdefoxABCDEF"):
            return text
        raise ConfigError(
            f"a number in line {line} has {len(text)} characters; allowed: {MAX_DIGITS}"
        )
    for pattern, number in NUMBERS:
        if pattern.fullmatch(text):
            return number(text.replace("_", ""))
    return text


def _require_tag(tag: str | None, value: Value, line: int) -> None:
    """Refuse a tag that is not one of YAML's own, or does not fit the value."""
    if tag in (None, "!"):
        return
    if not isinstance(value, TAGS.get(str(tag).removeprefix(TAG), ())):
        raise _wrong(line, f"the tag {str(tag)[:60]!r} does not fit; allowed: none")


def _require_depth(levels: int, line: int) -> None:
    if levels > MAX_DEPTH:
        raise ConfigError(f"is nested too deeply, in line {line}; allowed: {MAX_DEPTH} levels")


def _wrong(line: int, words: str) -> ConfigError:
    return ConfigError(f"not YAML: line {line}: {words}")
