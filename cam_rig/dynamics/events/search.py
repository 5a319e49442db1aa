"""How the event search runs: plain, or compiled by numba once and kept; the bits are the same."""

from __future__ import annotations

import hashlib
import importlib
import os
import sys
import time
from collections.abc import Callable
from functools import cache, partial
from importlib.util import find_spec
from inspect import isfunction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from cam_rig.laws import rows

#: Modules that are compiled as they are.
MODULES = (
    *("laws.rows", "laws.polynomials"),
    *("dynamics.events.law_table", "dynamics.events.free_flight", "dynamics.events.approach"),
    *("dynamics.events.contact", "dynamics.events.run_table"),
    *("dynamics.events.runs", "dynamics.events.turns"),
    *("dynamics.modal.motion", "dynamics.modal.least"),
    *("dynamics.modal.sags", "dynamics.modal.first_zero", "dynamics.jump.rigid"),
)
#: Seconds in plain Python after which compiled code is loaded, or made: loading takes as long.
LOAD_AFTER = 0.5
#: What the environment may say of it: plain Python alone, or compiled code from the first event on.
VARIABLE, PLAIN, ALWAYS = "CAM_RIG_EVENTS", "plain", "compiled"

Run = Callable[..., Any]
#: Seconds that plain Python has searched in this process.
SPENT = SimpleNamespace(seconds=0.0)


def form_of(function: Run) -> Run:
    """A function of the search, plain or compiled."""
    asked = os.environ.get(VARIABLE, "")
    soon = asked != ALWAYS and SPENT.seconds < LOAD_AFTER
    if asked == PLAIN or soon or find_spec("numba") is None:
        return partial(_timed, function)
    return _compiled(function)


def expect_many() -> None:
    """Load compiled code at the first search; a process that serves people searches often."""
    SPENT.seconds = max(SPENT.seconds, LOAD_AFTER)


def _timed(function: Run, *arguments: Any) -> Any:
    """What plain Python finds; its time counts."""
    begun = time.perf_counter()
    try:
        return function(*arguments)
    finally:
        SPENT.seconds += time.perf_counter() - begun


@cache
def _compiled(function: Run) -> Run:
    """The function for numba, which keeps its code in a folder of these sources."""
    import numba

    paths = [Path(rows.__file__).parents[1] / f"{name.replace('.', '/')}.py" for name in MODULES]
    stamp = hashlib.sha256(b"".join(map(Path.read_bytes, paths))).hexdigest()[:16]
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    folder = Path(base).expanduser() / "cam_rig" / f"events-{stamp}"
    if not any(folder.glob(f"*/*{function.__name__}-*.nbi")):
        print(f"events: compiling {function.__name__}, once (about 15 s)", file=sys.stderr)
    _register()
    usual, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder)
    try:
        return numba.njit(cache=True, error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = usual


@cache
def _register() -> None:
    """Tell numba that compiled code may call the functions of the search, and how it borrows."""
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic, overload, register_jitable

    def without_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
        if isinstance(kind, types.Array):
            array = cgutils.create_struct_proxy(kind)(context, builder, value=value)
            for field in ("meminfo", "parent"):
                empty = cgutils.get_null_value(getattr(array, field).type)
                setattr(array, field, empty)
            return array._getvalue()
        if isinstance(kind, types.BaseTuple):
            for i, inner in enumerate(kind.types):
                part = without_owner(context, builder, inner, builder.extract_value(value, i))
                value = builder.insert_value(value, part, i)
        return value

    @intrinsic
    def lent(_context: Any, table: Any) -> Any:
        """A table whose arrays are not counted as used: a third of the time is spent on that."""

        def made(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            return without_owner(context, builder, table, arguments[0])

        changeable = table.copy(readonly=False) if isinstance(table, types.Array) else table
        return changeable(table), made

    overload(rows.borrowed, strict=False)(lambda table: lambda table: lent(table))
    for name in MODULES:
        module = importlib.import_module(f"cam_rig.{name}")
        for function in vars(module).values():
            own = isfunction(function) and function.__module__ == module.__name__
            if own and function is not rows.borrowed:
                register_jitable(error_model="numpy", no_cfunc_wrapper=True)(function)


def call(function: Run, *arguments: Any) -> Any:
    """A function of the search, in plain Python or compiled."""
    return form_of(function)(*arguments)
