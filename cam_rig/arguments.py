"""Validation of the arguments of the functions that `import cam_rig` exposes.

The annotation of a parameter is its rule. `check_arguments` compares each argument with it before
the function runs, so that no other library receives a value that it cannot use. Commands call the
same functions, whose messages name options. In Python the messages name parameters instead.
"""

from __future__ import annotations

import inspect
import math
import os
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache, wraps
from pathlib import Path
from types import NoneType, SimpleNamespace, UnionType
from typing import Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from cam_rig.errors import ArgumentTypeError, CamRigError, ConfigError, did_you_mean
from cam_rig.units import FloatArray

P = ParamSpec("P")
R = TypeVar("R")
#: Allowed values of a parameter by its type, as text for an error.
ALLOWED_TEXTS: dict[Any, str] = {
    bool: "True or False",
    int: f"a whole number below {2**63:.2g}",
    float: "a finite number",
    str: "a text without NUL",
    Path: "a path",
    NoneType: "None",
    Mapping: "a mapping",
    Callable: "a function",
    np.ndarray: "an array of real numbers",
}
#: Description of the objects of a class, and the function or module that creates them, by the name
#: of the class.
MAKERS = {
    "CamConfig": ("a cam", "load_cam"),
    "RigConfig": ("a rig", "load_rig"),
    "LoadedScene": ("a scene", "load_scene"),
    "Law": ("a Law", "build_law"),
    "FollowerMotion": ("a motion", "simulate"),
    "Axes": ("axes", "matplotlib"),
    "DataFrame": ("a data frame", "pandas"),
    "Executor": ("an executor", "concurrent.futures"),
    "Progress": ("a Progress", "cam_rig.show.result"),
}
#: Pattern of a long option of a command in a message.
OPTION = re.compile(r"(?<![\w-])--([a-z]+(?:-[a-z]+)*)")
#: Name of a parameter of a Python function, by the name of the command-line option with the same
#: meaning, if the names differ. A parameter may also have the name of the option with a unit as
#: suffix, such as offset_deg for --offset.
ALIASES = {"cam": "one_cam", "all": "every", "limit": "limits", "from": "start", "range": "values"}


def check_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """Return the function with a check of each argument against its annotation.

    The returned function raises ConfigError for a wrong value, and ArgumentTypeError for a wrong
    type. Scalars of NumPy are converted to Python's.
    """
    signature = inspect.signature(function)

    @cache
    def hints() -> dict[str, Any]:
        every = {name: p.annotation for name, p in signature.parameters.items() if name != "self"}
        return get_type_hints(SimpleNamespace(__annotations__=every), function.__globals__)

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            bound = signature.bind(*args, **kwargs)
        except TypeError:
            return function(*args, **kwargs)  # raises Python's own message
        for name, hint in hints().items():
            if name in bound.arguments:
                value = bound.arguments[name]
                value = value.item() if isinstance(value, np.generic) else value
                if not _fits(value, hint):
                    kind = ConfigError if _has_type(value, hint) else ArgumentTypeError
                    raise kind(_refusal(name, value, hint))
                bound.arguments[name] = value
        try:
            return function(*bound.args, **bound.kwargs)
        except CamRigError as error:
            error.args = (name_parameters(str(error), signature.parameters),)
            raise

    return call


def name_parameters(message: str, parameters: Collection[str]) -> str:
    """Return an error message with options of a command replaced by parameters.

    `parameters` are the names of the function's parameters. An option without a parameter is kept.
    """

    def parameter(option: re.Match[str]) -> str:
        same = option[1].replace("-", "_")
        with_unit = [name for name in parameters if name.startswith(f"{same}_")]
        names = [ALIASES.get(same, same), same, *with_unit]
        return next((name for name in names if name in parameters), option[0])

    return OPTION.sub(parameter, message)


def to_vector(name: str, value: float | Sequence[float] | FloatArray) -> FloatArray:
    """Convert a number or a sequence of numbers to an array, shape (n,).

    Raise ConfigError with `name` if the sequence is empty or has several axes.
    """
    array = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if array.ndim > 1 or not array.size:
        description = f"an array of shape {array.shape}" if array.size else "empty"
        raise ConfigError(f"{name}: is {description}; allowed: a number, or several on one axis")
    return array


def _fits(value: Any, hint: Any) -> bool:
    """Return True if a value is allowed by a type annotation.

    It must have the type of the annotation, and satisfy the condition for this type in
    `CONDITIONS`.
    """
    kind, inner = get_origin(hint) or hint, get_args(hint)
    if kind in (Union, UnionType):
        return any(_fits(value, member) for member in inner)
    if kind is Literal:
        return isinstance(value, str) and value in inner
    if kind is float:
        return _fits(value, int) or (isinstance(value, float) and math.isfinite(value))
    if kind is Sequence:
        is_sequence = isinstance(value, Sequence) and not isinstance(value, str | bytes)
        return is_sequence and all(_fits(item, inner[0]) for item in value)
    if kind is Mapping and inner:
        has_keys = isinstance(value, Mapping) and all(_fits(key, inner[0]) for key in value)
        return has_keys and (
            inner[1] is Any or all(_fits(item, inner[1]) for item in value.values())
        )
    return isinstance(value, kind) and CONDITIONS.get(kind, lambda _: True)(value)


def _has_type(value: Any, hint: Any) -> bool:
    """Return True if a rejected value has the right type, such as NaN for a number."""
    kind, inner = get_origin(hint) or hint, get_args(hint)
    if kind in (Union, UnionType):
        return any(_has_type(value, member) for member in inner)
    if isinstance(value, bool):
        return kind is bool
    if kind in (Literal, float):
        return isinstance(value, str if kind is Literal else int | float)
    if kind is Sequence and not isinstance(value, str | bytes):
        return isinstance(value, Sequence) and all(_has_type(item, inner[0]) for item in value)
    return isinstance(value, kind)


def _can_be_a_path(value: str | Path) -> bool:
    """Return True if the operating system can use a text as a path.

    It must not contain NUL or half of a surrogate pair.
    """
    try:
        return b"\0" not in os.fsencode(value)
    except UnicodeEncodeError:
        return False


#: Condition that a value must satisfy in addition to having the type, by type.
CONDITIONS: dict[Any, Callable[[Any], bool]] = {
    int: lambda value: not isinstance(value, bool) and abs(value) < 2**63,
    str: _can_be_a_path,
    Path: _can_be_a_path,
    np.ndarray: lambda value: value.dtype.kind in "iuf",
}


def _refusal(name: str, value: Any, hint: Any) -> str:
    """Return the error message for a wrong argument, or wrong item of a mapping."""
    for member in (hint, *get_args(hint)):
        if get_origin(member) is Mapping and isinstance(value, Mapping):
            key_hint, item_hint = get_args(member)
            for key, item in value.items():
                if not _fits(key, key_hint):
                    return _refusal(f"a name in {name}", key, key_hint)
                if item_hint is not Any and not _fits(item, item_hint):
                    return _refusal(f"{name}[{key!r}]", item, item_hint)
    text = type(value).__name__
    if isinstance(value, str | Path | float | list | tuple | NoneType) or _fits(value, int | bool):
        text = f"{repr(value)[:60]} ({text})"
    elif isinstance(value, np.ndarray):
        text = f"array of {value.dtype}"
    elif isinstance(value, int):
        text = "int of more than 63 bits"
    return f"{name}: is {text}; allowed: {_text_of_type(hint, value)}"


def _text_of_type(hint: Any, value: Any) -> str:
    """Return a text on the values that an annotation allows.

    It contains a similar allowed name, or the call that loads `value`.
    """
    kind, inner = get_origin(hint) or hint, get_args(hint)
    if kind in (Union, UnionType):
        return " or ".join(_text_of_type(member, value) for member in inner)
    if kind is Sequence:
        return f"a list, each {_text_of_type(inner[0], value)}"
    if kind is Literal:
        similar = did_you_mean(value, inner).strip() if isinstance(value, str) else ""
        return " ".join(filter(None, (" or ".join(map(repr, inner)), similar)))
    if kind in ALLOWED_TEXTS:
        return ALLOWED_TEXTS[kind]
    description, maker = MAKERS[kind.__name__]
    is_name = maker.startswith("load_") and isinstance(value, str | Path)
    call = f"{maker}({str(value)[:60]!r})" if is_name else maker
    return f"{description}, of {call}"
