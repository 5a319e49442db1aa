"""YAML as people write it, by PyYAML's safe loader with the numbers and words of YAML 1.2."""

from __future__ import annotations

import re
from typing import Any

import yaml

from cam_rig.errors import ConfigError

#: Levels of lists and mappings within each other; characters of a number; values in all.
MAX_DEPTH, MAX_DIGITS, MAX_VALUES = 32, 300, 1_000_000
BASE: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
TAG = "tag:yaml.org,2002:"
WORDS = {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?(?:0o[0-7_]+|0x[0-9a-fA-F_]+|0b[01_]+|[0-9][0-9_]*)",
    "float": r"[-+]?(?:[0-9][0-9_]*\.?[0-9_]*|\.[0-9][0-9_]*)(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
    "merge": "<<",
}


class Loader(BASE):  # type: ignore[misc]
    """YAML 1.2's scalars; no key twice."""

    yaml_implicit_resolvers: dict[str, Any] = {}

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """A mapping whose keys are texts, numbers or truths, each there once."""
        own = [self.construct_object(key) for key, _ in node.value if key.tag != f"{TAG}merge"]
        for key, value in zip((k for k, _ in node.value), own, strict=False):
            if isinstance(value, list | dict):
                raise _wrong(key, "a list or a mapping is a key; allowed: a text")
            if own.count(value) > 1:
                raise _wrong(key, f"the key {str(value)[:40]!r} is there twice")
        return super().construct_mapping(node, deep)


def _wrong(where: Any, words: str) -> ConfigError:
    return ConfigError(f"not YAML: line {where.start_mark.line + 1}: {words}")


def _number(loader: Loader, node: Any) -> int | float:
    text = node.value.replace("_", "")
    if len(node.value) > MAX_DIGITS:
        raise _wrong(node, f"a number has {len(node.value)} characters; allowed: {MAX_DIGITS}")
    if node.tag.endswith("int"):
        return int(text, 0 if text.lstrip("+-")[:2] in ("0o", "0x", "0b") else 10)
    return float(text.replace(".inf", "inf").replace(".nan", "nan"))


for kind, pattern in WORDS.items():
    Loader.add_implicit_resolver(f"{TAG}{kind}", re.compile(rf"(?:{pattern})\Z"), None)
for kind in ("int", "float"):
    Loader.add_constructor(f"{TAG}{kind}", _number)


def parse_yaml(text: str) -> Any:
    """The one document of a text; None where it has none."""
    try:
        depth = values = 0
        for event in yaml.parse(text, Loader=BASE):
            values += isinstance(event, yaml.NodeEvent)
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_DEPTH:
                raise _wrong(event, f"is nested too deeply; allowed: {MAX_DEPTH} levels")
            if values > MAX_VALUES:
                raise _wrong(event, f"has more than {MAX_VALUES} values")
        return yaml.load(text, Loader=Loader)
    except yaml.YAMLError as error:
        words = " ".join(str(error).split()).replace('in "<unicode string>", ', "at ")
        raise ConfigError(f"not YAML: {words}") from None
