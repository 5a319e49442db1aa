"""One-line messages for errors of pydantic: key, value and allowed values."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.schema.quantity import PYTHON_CONTEXT

Config = TypeVar("Config", bound=BaseModel)
#: Largest number of wrong keys that a message names in addition to the explained key.
MAX_OTHER_KEYS = 3
#: Text of the remedy for a number with a decimal comma.
DECIMAL_POINT = "a number has a decimal point, not a comma"
#: Text on the allowed form of a quantity, with an example.
QUANTITY_FORM = "a number by its origin, with its unit, as {given: 15, unit: mm, source: drawing}"


def describe_type(value: object) -> str:
    """Return the kind of a YAML value as text."""
    if value is None:
        return "nothing"
    names: dict[type, str] = {list: "a list", str: "text", dict: "a mapping"}
    return names.get(type(value), f"a {type(value).__name__}")


def validate_in_python(kind: type[Config], data: Mapping[str, Any], label: str) -> Config:
    """Validate the values of a cam or rig that Python code constructs.

    Plain numbers in SI units and texts with a unit are accepted. Raise ConfigError if a value is
    wrong. `label` is "cam" or "rig", for the message.
    """
    try:
        return kind.model_validate(dict(data), context=PYTHON_CONTEXT)
    except ValidationError as error:
        raise python_error(label, data.get("name"), error, kind) from None


def validate_data(
    kind: type[Config], data: object, label: object = "", folder: Path | None = None
) -> Config:
    """Validate data in the form of a file. Raise ConfigError if they are wrong.

    `label` names the data in the message. `folder` contains the files that the data refer to.
    """
    try:
        return kind.model_validate(data, context={"folder": folder or Path()})
    except ValidationError as error:
        prefix = f"{label}: " if label else ""
        raise ConfigError(f"{prefix}{explain(error, kind)}") from None


def python_error(
    label: str, name: object, error: ValidationError, kind: type[BaseModel]
) -> ConfigError:
    """Return the error for a wrong cam or rig that was made in Python."""
    return ConfigError(f"{label} {_value_text(name)}: {explain(error, kind)}")


def explain(error: ValidationError, kind: type[BaseModel]) -> str:
    """Return a message that explains one problem, and names the keys of the others."""
    problems = error.errors()
    # first an unknown key, because it is often the misspelt name of a missing key
    first = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
    keys = [_key(p, kind) or str(p["msg"]) for p in problems if p is not first]
    others = [key for key in dict.fromkeys(keys) if key != _key(first, kind)]
    count = len(others) - MAX_OTHER_KEYS
    more = f" and {count} more" if count > 0 else ""
    also = f" (also wrong: {', '.join(others[:MAX_OTHER_KEYS])}{more})" if others else ""
    return _problem_text(first, kind) + also


def _problem_text(problem: ErrorDetails, kind: type[BaseModel]) -> str:
    """Return a problem as text: key, value and allowed values."""
    key, value, context = _key(problem, kind), _value_text(problem["input"]), problem.get("ctx", {})
    tag = str(context.get("discriminator", "")).strip("'")
    match problem["type"]:
        case "extra_forbidden":
            parents = problem["loc"][:-1]
            properties = _nodes(kind, parents)[-1].get("properties", {})
            allowed = sorted(properties if parents else kind.model_fields)
            hint = did_you_mean(str(problem["loc"][-1]), allowed)
            listing = f"; allowed: {', '.join(allowed)}" if allowed else ""
            text = f"{key}: unknown key, value {value}{hint}{listing}"
        case "missing":
            text = f"{key}: missing; it is required"
        case "value_error":
            text = f"{key}: {context['error']}" if key else str(context["error"])
        case "union_tag_not_found":
            node = _nodes(kind, problem["loc"])[-1]
            names = ", ".join(node.get("discriminator", {}).get("mapping", {}))
            text = f"{key}.{tag}: missing; allowed: one of {names}"
        case "union_tag_invalid":
            names, name = str(context["expected_tags"]), context["tag"]
            text = f"{key}.{tag}: is {name!r}{_suggestion(name, names)}; allowed: {names}"
        case "literal_error":
            names = str(context["expected"])
            text = f"{key}: is {value}{_suggestion(problem['input'], names)}; allowed: {names}"
        case "string_pattern_mismatch":
            text = f"{key}: is {value}; allowed: lower case letters, digits and _"
        case "too_short":
            text = f"{key}: is {value}; allowed: at least {context['min_length']} of them"
        case "model_type" if context.get("class_name") == "Quantity":
            text = f"{key}: is {value}; allowed: {QUANTITY_FORM}"
        case "invalid_key":  # {assumed: 7,4} is the number 7 and a key 4
            text = f"{key.rpartition('[')[0]}: the key {value} is not a text; {DECIMAL_POINT}"
        case _:
            rule = problem["msg"].removeprefix("Input should be ")
            text = f"{key}: is {value}; allowed: {rule.replace('valid integer', 'whole number')}"
            if re.fullmatch(r"'-?\d+,\d+'", value):
                text += f"; {DECIMAL_POINT}"
    return text


def _suggestion(name: object, names: str) -> str:
    """Return a suggestion from the names that pydantic lists in quotes."""
    return did_you_mean(str(name), re.findall(r"'([^']*)'", names))


@cache
def _schema(kind: type[BaseModel]) -> Any:
    return kind.model_json_schema()


def _nodes(kind: type[BaseModel], loc: tuple[int | str, ...]) -> list[Any]:
    """Return the nodes of a model's JSON schema along pydantic's location of an error.

    The first node is that of the model.
    """
    schema = _schema(kind)
    nodes = [_resolve(schema, schema)]
    for part in loc:
        nodes.append(_resolve(_child(nodes[-1], part), schema))
    return nodes


def _value_text(value: object) -> str:
    """Return a value as text, shortened to 60 characters."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    try:
        text = describe_type(value) if isinstance(value, dict) else repr(value)
    except ValueError:  # an integer with thousands of digits cannot be printed
        text = describe_type(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _key(problem: ErrorDetails, kind: type[BaseModel]) -> str:
    """Return the path of a problem, such as "segments[1].span".

    Pydantic's location also contains names of union members, which are left out.
    """
    out = ""
    for part, node in zip(problem["loc"], _nodes(kind, problem["loc"]), strict=False):
        if isinstance(part, int):
            out += f"[{part}]"
        elif "discriminator" in node or "oneOf" in node:
            continue  # the tag of a union
        elif part in ("float", "list[float]") or part.startswith(("constrained-", "list[")):
            continue  # a member of the union of number and list of numbers
        else:
            out += f".{part}" if out else part
    return out


def _resolve(node: Any, schema: Any) -> Any:
    """Return the described type of a JSON schema node.

    References are followed, and of an optional node the alternative to null is taken. An unknown
    node gives an empty mapping.
    """
    while isinstance(node, dict):
        if "$ref" in node:
            node = schema["$defs"][node["$ref"].rsplit("/", 1)[-1]]
        elif "anyOf" in node:
            node = next((n for n in node["anyOf"] if n.get("type") != "null"), {})
        else:
            return node
    return {}


def _child(node: Any, part: int | str) -> Any:
    """Return the child of a resolved node: for a key, an index, or the tag of a union."""
    if isinstance(part, int):
        return node.get("items")
    if "discriminator" in node:
        reference = node["discriminator"]["mapping"].get(part)
        return reference and {"$ref": reference}
    return node.get("properties", {}).get(part)
