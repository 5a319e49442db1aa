"""A pydantic error in one line: the key, its value, and what is allowed."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import cache
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.schema.quantity import PYTHON_CONTEXT

Config = TypeVar("Config", bound=BaseModel)
#: Other keys that are wrong, named in the same line.
NAMED = 3
POINT = "a number has a decimal point, not a comma"
QUANTITY = "a number by its origin, with its unit, as {given: 15, unit: mm, source: drawing}"


def kind_of(value: object) -> str:
    """What a YAML value is, in words."""
    if value is None:
        return "nothing"
    names: dict[type, str] = {list: "a list", str: "text", dict: "a mapping"}
    return names.get(type(value), f"a {type(value).__name__}")


def made(kind: type[Config], data: Mapping[str, Any], what: str) -> Config:
    """A model of what Python gives it, plain numbers and texts with their unit among them."""
    try:
        return kind.model_validate(dict(data), context=PYTHON_CONTEXT)
    except ValidationError as error:
        raise refused(what, data.get("name"), error, kind) from None


def validated(kind: type[Config], data: object) -> Config:
    """A model of what a file would hold; what is wrong with it is said in one line."""
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise ConfigError(explain(error, kind)) from None


def refused(what: str, name: object, error: ValidationError, kind: type[BaseModel]) -> ConfigError:
    """What is said of a cam or a rig that Python has made wrongly."""
    return ConfigError(f"{what} {_shown(name)}: {explain(error, kind)}")


def explain(error: ValidationError, kind: type[BaseModel]) -> str:
    """The problem that tells most, in words, and the keys of the others, each once."""
    problems = error.errors()  # an unknown key is often one that is missing, misspelt
    first = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
    wrong = [_key(p, kind) or str(p["msg"]) for p in problems if p is not first]
    others = [key for key in dict.fromkeys(wrong) if key != _key(first, kind)]
    more = f" and {len(others) - NAMED} more" if len(others) > NAMED else ""
    also = f" (also wrong: {', '.join(others[:NAMED])}{more})" if others else ""
    return _sentence(first, kind) + also


def _sentence(problem: ErrorDetails, kind: type[BaseModel]) -> str:
    key, shown, context = _key(problem, kind), _shown(problem["input"]), problem.get("ctx", {})
    tag = str(context.get("discriminator", "")).strip("'")
    match problem["type"]:
        case "extra_forbidden":
            above = problem["loc"][:-1]
            properties = _along(kind, above)[-1].get("properties", {})
            allowed = sorted(properties if above else kind.model_fields)
            hint = did_you_mean(str(problem["loc"][-1]), allowed)
            listing = f"; allowed: {', '.join(allowed)}" if allowed else ""
            text = f"{key}: unknown key, value {shown}{hint}{listing}"
        case "missing":
            text = f"{key}: missing; it is required"
        case "value_error":
            text = f"{key}: {context['error']}" if key else str(context["error"])
        case "union_tag_not_found":
            node = _along(kind, problem["loc"])[-1]
            known = ", ".join(node.get("discriminator", {}).get("mapping", {}))
            text = f"{key}.{tag}: missing; allowed: one of {known}"
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
        case "model_type" if context.get("class_name") == "Quantity":
            text = f"{key}: is {shown}; allowed: {QUANTITY}"
        case "invalid_key":  # {assumed: 7,4} is the number 7 and a key 4
            text = f"{key.rpartition('[')[0]}: the key {shown} is no text; {POINT}"
        case _:
            rule = problem["msg"].removeprefix("Input should be ")
            text = f"{key}: is {shown}; allowed: {rule.replace('valid integer', 'whole number')}"
            if re.fullmatch(r"'-?\d+,\d+'", shown):
                text += f"; {POINT}"
    return text


def _hint(name: object, known: str) -> str:
    """The likeliest of the names that pydantic lists in quotes."""
    return did_you_mean(str(name), re.findall(r"'([^']*)'", known))


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
