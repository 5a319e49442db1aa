"""Parser of YAML 1.2 documents of limited size and depth, based on PyYAML."""

from __future__ import annotations

import re
from typing import Any

import yaml

from cam_rig.errors import ConfigError

#: Largest depth of nested lists and mappings in a document.
MAX_DEPTH = 32
#: Largest length of a number in a document, in characters.
MAX_DIGITS = 300
#: Largest number of values in a document.
MAX_VALUES = 1_000_000
#: Loader of PyYAML, the compiled one if it is available.
BASE: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
#: Prefix of the tags of YAML.
TAG = "tag:yaml.org,2002:"
#: Tags that a document may contain explicitly, such as ``!!str 3``.
EXPLICIT_TAGS = (None, f"{TAG}str", f"{TAG}int", f"{TAG}float")
#: Patterns of the plain scalars of YAML 1.2 that are not text, by tag.
SCALARS = {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?(?:0o[0-7_]+|0x[0-9a-fA-F_]+|0b[01_]+|[0-9][0-9_]*)",
    "float": r"[-+]?(?:[0-9][0-9_]*\.?[0-9_]*|\.[0-9][0-9_]*)(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
    "merge": "<<",
}


class Loader(BASE):  # type: ignore[misc]
    """Safe loader with the scalars of YAML 1.2 and unique keys."""

    # PyYAML collects resolvers per class; an empty table drops those of YAML 1.1 (yes, on, dates).
    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """Return the mapping of a node. Raise ConfigError if a key is repeated or a list."""
        keys = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise _error(key, "a list or a mapping is a key; use text")
            if key.tag == f"{TAG}merge":
                raise _error(key, "merge key << is not supported; write the keys out")
            value = self.construct_object(key)
            if value in keys:
                raise _error(key, f"duplicate key {str(value)[:40]!r}")
            keys.add(value)
        return super().construct_mapping(node, deep)


def _error(node: Any, text: str) -> ConfigError:
    return ConfigError(f"not YAML: line {node.start_mark.line + 1}: {text}")


def _number(loader: Loader, node: Any) -> int | float:
    text = node.value.replace("_", "")
    if len(node.value) > MAX_DIGITS:
        raise _error(node, f"number with {len(node.value)} characters; at most {MAX_DIGITS}")
    try:
        if node.tag.endswith("int"):
            return int(text, 0 if text.lstrip("+-")[:2] in ("0o", "0x", "0b") else 10)
        return float(re.sub(r"\.(?=inf|nan)", "", text.lower()))
    except ValueError:
        raise _error(node, f"{node.value[:40]!r} is not a number") from None


for kind, pattern in SCALARS.items():
    Loader.add_implicit_resolver(f"{TAG}{kind}", re.compile(rf"(?:{pattern})\Z"), None)
for kind in ("int", "float"):
    Loader.add_constructor(f"{TAG}{kind}", _number)


def parse_yaml(text: str) -> Any:
    """Return the value of the only document of a text, or None for an empty text.

    Raise ConfigError with the line if the text is not YAML, or exceeds a limit of this module.
    Aliases are refused, because a few lines of them expand to any number of values.
    """
    try:
        depth = values = 0
        for event in yaml.parse(text, Loader=BASE):
            if isinstance(event, yaml.AliasEvent):
                raise _error(
                    event, f"alias *{event.anchor[:40]} is not supported; repeat the value"
                )
            if getattr(event, "tag", None) not in EXPLICIT_TAGS:
                raise _error(event, f"tag {event.tag[:60]!r} is not supported")
            values += isinstance(event, yaml.NodeEvent)
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_DEPTH:
                raise _error(event, f"nested too deeply; at most {MAX_DEPTH} levels")
            if values > MAX_VALUES:
                raise _error(event, f"more than {MAX_VALUES} values")
        return yaml.load(text, Loader=Loader)
    except yaml.YAMLError as error:
        message = " ".join(str(error).split()).replace('in "<unicode string>", ', "at ")
        raise ConfigError(f"not YAML: {message}") from None
