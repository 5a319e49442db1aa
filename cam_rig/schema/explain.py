"""A pydantic error in one line: the key, its value, and what is allowed."""

from __future__ import annotations

import math
import re
from functools import cache
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from cam_rig.errors import did_you_mean

#: Other keys that are wrong, named in the same line.
NAMED = 3


def kind_of(value: object) -> str:
    """What a YAML value is, in words."""
    if value is None:
        return "nothing"
    names: dict[type, str] = {list: "a list", str: "text", dict: "a mapping"}
    return names.get(type(value), f"a {type(value).__name__}")


def explain(error: ValidationError, kind: type[BaseModel]) -> str:
    """The problem that tells most, in words, and the keys of the others.

    An unknown key comes first: the key that is missing beside it is often the same, misspelt.
    """
    problems = error.errors()
    first = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
    others = [_key(p, kind) or str(p["msg"]) for p in problems if p is not first]
    return _sentence(first, kind) + _more(list(dict.fromkeys(others)))


def _more(others: list[str]) -> str:
    """What else is wrong, `NAMED` by their keys; a key with two errors stands once."""
    if not others:
        return ""
    rest = len(others) - NAMED
    return f" (also wrong: {', '.join(others[:NAMED])}{f' and {rest} more' if rest > 0 else ''})"


def _sentence(problem: ErrorDetails, kind: type[BaseModel]) -> str:
    key, shown, context = _key(problem, kind), _shown(problem["input"]), problem.get("ctx", {})
    tag = str(context.get("discriminator", "")).strip("'")
    match problem["type"]:
        case "extra_forbidden":
            text = _unknown_key(problem, kind)
        case "missing":
            text = f"{key}: missing; it is required"
        case "value_error":
            text = f"{key}: {context['error']}" if key else str(context["error"])
        case "union_tag_not_found":
            text = f"{key}.{tag}: missing; allowed: one of {_tags(kind, problem)}"
        case "union_tag_invalid":
            known = str(context["expected_tags"])
            name = context["tag"]
            text = f"{key}.{tag}: is {name!r}{_hint(name, known)}; allowed: {known}"
        case "literal_error":
            known = str(context["expected"])
            text = f"{key}: is {shown}{_hint(problem['input'], known)}; allowed: {known}"
        case "string_pattern_mismatch":
            text = f"{key}: is {shown}; allowed: lower case letters, digits and _"
        case "too_short":
            text = f"{key}: is {shown}; allowed: at least {context['min_length']} of them"
        case _:
            text = f"{key}: is {shown}; allowed: {problem['msg'].removeprefix('Input should be ')}"
    return text


def _hint(name: object, known: str) -> str:
    """The likeliest of the names that pydantic lists in quotes."""
    return did_you_mean(str(name), re.findall(r"'([^']*)'", known))


def _unknown_key(problem: ErrorDetails, kind: type[BaseModel]) -> str:
    key, shown = _key(problem, kind), _shown(problem["input"])
    allowed = sorted(_fields_at(kind, problem["loc"][:-1]))
    hint = did_you_mean(str(problem["loc"][-1]), allowed)
    listing = f"; allowed: {', '.join(allowed)}" if allowed else ""
    return f"{key}: unknown key, value {shown}{hint}{listing}"


@cache
def _schema(kind: type[BaseModel]) -> Any:
    return kind.model_json_schema()


def _along(kind: type[BaseModel], loc: tuple[int | str, ...]) -> list[Any]:
    """The node of a model's schema that each part of a location leads to, the model's first."""
    schema = _schema(kind)
    nodes = [_resolve(schema, schema)]
    for part in loc:
        nodes.append(_resolve(_step(nodes[-1], part), schema))
    return nodes


def _tags(kind: type[BaseModel], problem: ErrorDetails) -> str:
    """The tags of a union: the names of its members."""
    node = _along(kind, problem["loc"])[-1]
    return ", ".join(node.get("discriminator", {}).get("mapping", {}))


def _shown(value: object) -> str:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    try:
        text = kind_of(value) if isinstance(value, dict) else repr(value)
    except ValueError:  # a whole number of thousands of digits
        text = kind_of(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _key(problem: ErrorDetails, kind: type[BaseModel]) -> str:
    """``segments[1].span`` from pydantic's location, without the names of union members."""
    out = ""
    for part, node in zip(problem["loc"], _along(kind, problem["loc"]), strict=False):
        if isinstance(part, int):
            out += f"[{part}]"
        elif "discriminator" in node:
            continue  # the tag of a union
        elif part in ("float", "list[float]") or part.startswith(("constrained-", "list[")):
            continue  # a member of number | list of numbers
        else:
            out += f".{part}" if out else part
    return out


def _fields_at(kind: type[BaseModel], loc: tuple[int | str, ...]) -> set[str]:
    """The keys allowed at a location, as far as the model's annotations tell."""
    node = _along(kind, loc)[-1]
    return set(node.get("properties", {})) if loc else set(kind.model_fields)


def _resolve(node: Any, schema: Any) -> Any:
    while isinstance(node, dict):
        if "$ref" in node:
            node = schema["$defs"][node["$ref"].rsplit("/", 1)[-1]]
        elif "anyOf" in node:
            node = next((n for n in node["anyOf"] if n.get("type") != "null"), {})
        else:
            return node
    return {}


def _step(node: Any, part: int | str) -> Any:
    """From a resolved node to what a key, a place in a list, or a union's tag leads to."""
    if isinstance(part, int):
        return node.get("items")
    if "discriminator" in node:
        reference = node["discriminator"]["mapping"].get(part)
        return reference and {"$ref": reference}
    return node.get("properties", {}).get(part)
