"""What the functions of `import cam_rig` may be given: refused by the argument's name.

What a parameter takes is its annotation; `checked` compares each argument with it before the
function begins, so that no other library meets what it cannot take. Commands call the same
functions, so what these refuse themselves names options; to Python it names parameters.
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
#: What a parameter of a type takes, in words; of the rig's own with the function that makes one.
WORDS: dict[Any, str] = {
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
MAKERS = {
    "CamConfig": ("a cam", "load_cam"),
    "RigConfig": ("a rig", "load_rig"),
    "LoadedScene": ("a scene", "load_scene"),
    "Law": ("a Law", "build_law"),
    "FollowerMotion": ("a motion", "simulate"),
    "Executor": ("an executor", "concurrent.futures"),
    "Progress": ("a Progress", "cam_rig.show.result"),
}
OPTION = re.compile(r"(?<![\w-])--([a-z]+(?:-[a-z]+)*)")
#: Options whose parameter has another name, where the function has it; one with a unit has the
#: unit behind the option's name.
RENAMED = {"cam": "one_cam", "all": "every", "limit": "limits", "from": "start", "range": "values"}


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """The same function, which refuses an argument that is not what its annotation says."""
    signature = inspect.signature(function)

    @cache
    def hints() -> dict[str, Any]:
        own = {name: p.annotation for name, p in signature.parameters.items() if name != "self"}
        return get_type_hints(SimpleNamespace(__annotations__=own), function.__globals__)

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            given = signature.bind(*args, **kwargs)
        except TypeError:
            return function(*args, **kwargs)  # Python's own words of a name or a number of them
        for name, hint in hints().items():
            if name in given.arguments:
                value = given.arguments[name]
                value = value.item() if isinstance(value, np.generic) else value
                if not _fits(value, hint):
                    kind = ConfigError if _is_of(value, hint) else ArgumentTypeError
                    raise kind(_refusal(name, value, hint))
                given.arguments[name] = value
        try:
            return function(*given.args, **given.kwargs)
        except CamRigError as error:
            error.args = (in_python(str(error), signature.parameters),)
            raise

    return call


def in_python(message: str, parameters: Collection[str]) -> str:
    """A refusal with the parameters of a function in place of a command's options."""

    def parameter(option: re.Match[str]) -> str:
        own = option[1].replace("-", "_")
        with_unit = [name for name in parameters if name.startswith(f"{own}_")]
        names = [RENAMED.get(own, own), own, *with_unit]
        return next((name for name in names if name in parameters), option[0])

    return OPTION.sub(parameter, message)


def on_one_axis(name: str, value: float | Sequence[float] | FloatArray) -> FloatArray:
    """A number or several as ``(n,)``; refused where there are none, or a table of them."""
    given = np.atleast_1d(np.asarray(value, dtype=np.float64))
    if given.ndim > 1 or not given.size:
        what = f"an array of shape {given.shape}" if given.size else "empty"
        raise ConfigError(f"{name}: is {what}; allowed: a number, or several on one axis")
    return given


def _fits(value: Any, hint: Any) -> bool:
    kind, inner = get_origin(hint) or hint, get_args(hint)
    if kind in (Union, UnionType):
        return any(_fits(value, one) for one in inner)
    if kind is Literal:
        return isinstance(value, str) and value in inner
    if kind is float:
        return _fits(value, int) or (isinstance(value, float) and math.isfinite(value))
    if kind is Sequence:
        there = isinstance(value, Sequence) and not isinstance(value, str | bytes)
        return there and all(_fits(one, inner[0]) for one in value)
    if kind is Mapping and inner:
        there = isinstance(value, Mapping) and all(_fits(key, inner[0]) for key in value)
        return there and (inner[1] is Any or all(_fits(one, inner[1]) for one in value.values()))
    return isinstance(value, kind) and MORE.get(kind, lambda _: True)(value)


def _is_of(value: Any, hint: Any) -> bool:
    """Whether only the value of an argument is wrong, as NaN is, and not its type."""
    kind, inner = get_origin(hint) or hint, get_args(hint)
    if kind in (Union, UnionType):
        return any(_is_of(value, one) for one in inner)
    if isinstance(value, bool):
        return kind is bool
    if kind in (Literal, float):
        return isinstance(value, str if kind is Literal else int | float)
    if kind is Sequence and not isinstance(value, str | bytes):
        return isinstance(value, Sequence) and all(_is_of(one, inner[0]) for one in value)
    return isinstance(value, kind)


def _can_be_a_path(value: str | Path) -> bool:
    """Whether a file can have this name: no text has a NUL, and none is half a character."""
    try:
        return b"\0" not in os.fsencode(value)
    except UnicodeEncodeError:
        return False


#: What else is asked of a value of a type.
MORE: dict[Any, Callable[[Any], bool]] = {
    int: lambda value: not isinstance(value, bool) and abs(value) < 2**63,
    str: _can_be_a_path,
    Path: _can_be_a_path,
    np.ndarray: lambda value: value.dtype.kind in "iuf",
}


def _refusal(name: str, value: Any, hint: Any) -> str:
    for one in (hint, *get_args(hint)):
        if get_origin(one) is Mapping and isinstance(value, Mapping):
            of_key, of_value = get_args(one)
            for key, inner in value.items():
                if not _fits(key, of_key):
                    return _refusal(f"a name in {name}", key, of_key)
                if of_value is not Any and not _fits(inner, of_value):
                    return _refusal(f"{name}[{key!r}]", inner, of_value)
    shown = type(value).__name__
    if isinstance(value, str | Path | float | list | tuple | NoneType) or _fits(value, int | bool):
        shown = f"{repr(value)[:60]} ({shown})"
    elif isinstance(value, np.ndarray):
        shown = f"array of {value.dtype}"
    elif isinstance(value, int):
        shown = "int of more than 63 bits"
    return f"{name}: is {shown}; allowed: {_words(hint, value)}"


def _words(hint: Any, value: Any) -> str:
    kind, inner = get_origin(hint) or hint, get_args(hint)
    if kind in (Union, UnionType):
        return " or ".join(_words(one, value) for one in inner)
    if kind is Sequence:
        return f"a list, each {_words(inner[0], value)}"
    if kind is Literal:
        hint_of = did_you_mean(value, inner).strip() if isinstance(value, str) else ""
        return " ".join(filter(None, (" or ".join(map(repr, inner)), hint_of)))
    if kind in WORDS:
        return WORDS[kind]
    what, maker = MAKERS[kind.__name__]
    named = maker.startswith("load_") and isinstance(value, str | Path)
    return f"{what}, of {maker}({str(value)[:60]!r})" if named else f"{what}, of {maker}"
