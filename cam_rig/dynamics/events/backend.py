"""Backend of the searches for lift-offs and landings: plain Python, or compiled by numba.

A kernel is a function that either backend can run. A process starts with plain Python, because
loading compiled code takes as long as a few searches. After `LOAD_AFTER_S` in kernels it changes to
compiled code. The environment variable ``CAM_RIG_EVENTS`` selects one backend for all calls. Both
backends give bit-identical results. Each kernel is compiled once and stored in a folder of the
user's cache. The folder's name contains a digest of the sources, because numba itself detects
changes in a kernel's file only, and not in the files of the functions that the kernel calls.
"""

from __future__ import annotations

import hashlib
import os
import sys
import time
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from inspect import isfunction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from cam_rig.laws import vectors

#: Modules whose functions compiled code may call, as paths relative to ``cam_rig``.
MODULES = (
    *("laws.vectors", "laws.polynomials"),
    *("dynamics.events.law_table", "dynamics.events.free_flight", "dynamics.events.approach"),
    *("dynamics.events.contact", "dynamics.events.run_table"),
    *("dynamics.events.runs", "dynamics.events.turns"),
    *("dynamics.modal.motion", "dynamics.modal.min_output"),
    *("dynamics.modal.group_error", "dynamics.modal.harmonic_error"),
    *("dynamics.modal.first_zero", "dynamics.jump.rigid_zero"),
)
#: Modules whose constants become part of the compiled code, as paths relative to ``cam_rig``.
CONSTANTS = ("units", "dynamics.velocity_jumps")
#: Time (s) that a process spends in event searches in plain Python before it changes to compiled
#: code. Loading the compiled code takes about as long.
LOAD_AFTER_S = 0.5
#: Environment variable that selects the backend of the event search.
VARIABLE = "CAM_RIG_EVENTS"
#: Value of `VARIABLE` that selects plain Python for all calls.
PLAIN = "plain"
#: Value of `VARIABLE` that selects compiled code from the first call on.
COMPILED = "compiled"

#: Function of the event search that plain Python and numba can both run.
Kernel = Callable[..., Any]
#: Time (s) that this process has spent in functions of the event search in plain Python.
_plain_time = SimpleNamespace(seconds=0.0)
#: Compiled form of each function of the event search that has been loaded, by its plain Python
#: function. It is the plain function itself if numba does not work.
_ready: dict[Kernel, Kernel] = {}


def dispatch(kernel: Kernel, *arguments: Any) -> Any:
    """Call a function with the selected backend, plain Python or numba.

    Returns the result of ``kernel(*arguments)``, which is the same with both backends.
    """
    if select_backend() == COMPILED:
        if kernel not in _ready:
            _ready[kernel] = _load(kernel, arguments)
        return _ready[kernel](*arguments)
    start = time.perf_counter()
    try:
        return kernel(*arguments)
    finally:
        _plain_time.seconds += time.perf_counter() - start


def select_backend() -> str:
    """Return the backend for the next event search, `PLAIN` or `COMPILED`.

    It is the value of the environment variable `VARIABLE` if that is set to one of them. Otherwise
    it is `COMPILED` after plain Python has spent `LOAD_AFTER_S` in kernels.
    """
    requested = os.environ.get(VARIABLE, "")
    if requested in (PLAIN, COMPILED):
        return requested
    return PLAIN if _plain_time.seconds < LOAD_AFTER_S else COMPILED


def expect_many() -> None:
    """Use compiled code from the next search for lift-offs and landings on.

    A process calls this function if it expects many searches, so that loading compiled code is
    worthwhile at once.
    """
    _plain_time.seconds = max(_plain_time.seconds, LOAD_AFTER_S)


def _load(kernel: Kernel, arguments: tuple[Any, ...]) -> Kernel:
    """Return the function that numba has compiled, or ``kernel`` if numba does not work.

    ``arguments`` determine the types for which it is compiled. A failure of numba is reported on
    stderr. If numba is not installed or its compiler is disabled, there is no report.
    """
    if find_spec("numba") is None:
        return kernel
    from multiprocessing.pool import ThreadPool

    failures: tuple[type[Exception], ...] = (ImportError, OSError, RuntimeError)
    try:
        numba: Any = import_module("numba")
        failures = (*failures, numba.core.errors.NumbaError)
        if numba.config.DISABLE_JIT:
            return kernel
        # Compile in a second thread, because a compilation cannot be interrupted. The main thread,
        # which waits here, can still raise KeyboardInterrupt.
        with ThreadPool(1) as pool:
            compiled: Kernel = pool.apply(_compile, (kernel, arguments))
        return compiled
    except failures as error:
        reason = f"{type(error).__name__}: {error}".partition("\n")[0]
        _print(f"using plain Python, because numba cannot compile {kernel.__name__} ({reason})")
        return kernel


def _compile(kernel: Kernel, arguments: tuple[Any, ...]) -> Kernel:
    """Return the function that numba has compiled, from the user's cache if it is there.

    ``arguments`` determine the types for which it is compiled. Newly compiled code is stored in the
    cache. Damaged code in the cache is replaced.
    """
    numba: Any = import_module("numba")
    name, folder = kernel.__name__, _cache_folder()
    folder.mkdir(parents=True, exist_ok=True)  # else numba would store code next to the sources
    _register()
    previous, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder)
    try:
        compiled = numba.njit(cache=True, error_model="numpy")(kernel)
    finally:
        numba.config.CACHE_DIR = previous
    types = tuple(map(compiled.typeof_pyval, arguments))
    indexes = list(folder.glob(f"*/*.{name}-*.nbi"))
    if not indexes:
        _print(f"compiling {name}, once (about 15 s)")
    try:
        compiled.compile(types)
    except Exception as error:  # damaged cache files may raise any error when they are unpickled
        if not indexes or isinstance(error, numba.core.errors.NumbaError):
            raise
        _print(f"compiling {name} again, because its stored code is damaged (about 15 s)")
        for index in indexes:
            index.unlink(missing_ok=True)
        compiled.compile(types)
    return compiled  # type: ignore[no-any-return]


def _print(message: str) -> None:
    print(f"events: {message}", file=sys.stderr)


@cache
def _cache_folder() -> Path:
    """Return the folder of the compiled code in the user's cache.

    Its name contains a digest of the source files, so that changed sources are compiled again.
    """
    package = Path(vectors.__file__).parents[1]
    paths = [package / f"{name.replace('.', '/')}.py" for name in (*MODULES, *CONSTANTS)]
    digest = hashlib.sha256(b"".join(map(Path.read_bytes, paths))).hexdigest()[:16]
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(base).expanduser() / "cam_rig" / f"events-{digest}"


@cache
def _register() -> None:
    """Make the functions of `MODULES` callable from code that numba compiles.

    `without_refcount` gets a special implementation, which removes the reference counters of arrays
    in compiled code.
    """
    cgutils: Any = import_module("numba.core.cgutils")
    extending: Any = import_module("numba.extending")
    types: Any = import_module("numba.core.types")

    def remove_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
        if isinstance(kind, types.Array):
            array = cgutils.create_struct_proxy(kind)(context, builder, value=value)
            for field in ("meminfo", "parent"):
                setattr(array, field, cgutils.get_null_value(getattr(array, field).type))
            return array._getvalue()
        if isinstance(kind, types.BaseTuple):
            for i, inner in enumerate(kind.types):
                part = remove_owner(context, builder, inner, builder.extract_value(value, i))
                value = builder.insert_value(value, part, i)
        return value

    @extending.intrinsic  # type: ignore[untyped-decorator]
    def replacement(_context: Any, table: Any) -> Any:
        def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            return remove_owner(context, builder, table, arguments[0])

        mutable = table.copy(readonly=False) if isinstance(table, types.Array) else table
        return mutable(table), generate

    def overloaded(table: Any) -> Any:  # numba requires the parameter name of the original
        return lambda table: replacement(table)  # noqa: PLW0108

    extending.overload(vectors.without_refcount, strict=False)(overloaded)
    for name in MODULES:
        module = import_module(f"cam_rig.{name}")
        for function in vars(module).values():
            is_local = isfunction(function) and function.__module__ == module.__name__
            if is_local and function is not vectors.without_refcount:
                extending.register_jitable(error_model="numpy", no_cfunc_wrapper=True)(function)
