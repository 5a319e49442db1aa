"""How the event search runs: plain, or compiled once and kept; piece by piece of a law."""

from __future__ import annotations

import atexit
import hashlib
import importlib
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from functools import cache, partial
from importlib.metadata import version
from importlib.util import find_spec
from inspect import isfunction
from pathlib import Path
from types import SimpleNamespace
from typing import Any, TypeVar

from cam_rig.laws import rows

#: Modules that are compiled as they are, beside `arrays`.
MODULES = (
    *("laws.rows", "laws.polynomials"),
    *("dynamics.events.law_table", "dynamics.events.free_flight", "dynamics.events.approach"),
    *("dynamics.events.contact", "dynamics.events.runs", "dynamics.events.turns"),
    *("dynamics.modal.motion", "dynamics.modal.least"),
    *("dynamics.modal.sags", "dynamics.modal.first_zero", "dynamics.jump.rigid"),
)
#: Seconds in plain Python after which the compiled code is loaded, or made.
LOAD_AFTER, COMPILE_AFTER = 0.5, 10.0
#: What the environment may say of it: plain Python alone, or compiled code from the first event on.
VARIABLE, PLAIN, ALWAYS = "CAM_RIG_EVENTS", "plain", "compiled"
#: Beside the files of one function's code: what each of them is called, and its SHA-256.
DIGESTS = "digests"

Run = Callable[..., Any]


#: Seconds that plain Python has searched in this process.
SPENT = SimpleNamespace(seconds=0.0)


def form_of(function: Run) -> tuple[Run, bool]:
    """A function of the search, plain or compiled, and whether it takes arrays for lists."""
    compiled = _compiled(function)
    return (partial(_timed, function), False) if compiled is None else (compiled, True)


def _compiled(function: Run) -> Run | None:
    """The compiled form; None where plain Python is to be used."""
    asked = os.environ.get(VARIABLE, "")
    if asked == PLAIN or (asked != ALWAYS and SPENT.seconds < LOAD_AFTER) or not _installed():
        return None
    if function.__name__ not in _ready:
        if asked != ALWAYS and SPENT.seconds < COMPILE_AFTER and not _is_kept(function):
            return None
        _ready[function.__name__] = _prepared(function)
    return _ready[function.__name__]


_ready: dict[str, Run | None] = {}


def expect_many() -> None:
    """Have kept code loaded at the first search: a process that serves people searches often."""
    SPENT.seconds = max(SPENT.seconds, LOAD_AFTER)


def _timed(function: Run, *arguments: Any) -> Any:
    """What plain Python finds; its time counts."""
    begun = time.perf_counter()
    try:
        return function(*arguments)
    finally:
        SPENT.seconds += time.perf_counter() - begun


@cache
def _installed() -> bool:
    with suppress(ModuleNotFoundError):
        return find_spec("numba") is not None
    return False


@cache
def _is_kept(function: Run) -> bool:
    """Whether a function's code is kept, and is what was written; what is not is removed."""
    folder = cache_folder() / function.__name__
    if not folder.exists():  # asked first: another process may put it there, whole, at any moment
        return False
    with suppress(OSError):
        if (folder / DIGESTS).read_bytes() == _digests(folder):
            return True
    print(f"events: {folder} is damaged: removed, to be compiled anew", file=sys.stderr)
    shutil.rmtree(folder, ignore_errors=True)
    return False


def _digests(folder: Path) -> bytes:
    """A line for each file of numba's index and code."""
    files = sorted(folder.rglob("*.nb[ic]"))
    return "".join(
        f"{hashlib.sha256(path.read_bytes()).hexdigest()} {path.relative_to(folder)}\n"
        for path in files
    ).encode()


def _prepared(function: Run) -> Run | None:
    """A run that compiles, or loads what is kept, at its first call; else plain, said once."""
    name = function.__name__
    folder = cache_folder() / name
    kept = _is_kept(function)
    if not kept:
        print(f"events: compiling {name}, once for this machine (about 30 s)", file=sys.stderr)

    def first(*arguments: Any) -> Any:
        from multiprocessing.pool import ThreadPool

        try:
            with nullcontext(folder) if kept else _made(folder) as place:
                compiled = _compile(function, place)
                # A signal is raised in the main thread, and half a compilation cannot be unwound.
                with ThreadPool(1) as apart:
                    out = apart.apply(compiled, arguments)
        except _failures() as error:
            # Before anything was computed: the search itself raises none of them.
            words = f"{type(error).__name__}: {error}".partition("\n")[0]
            print(
                f"events: plain Python is used, for numba does not work ({words})", file=sys.stderr
            )
            _ready[name] = None
            return function(*arguments)
        _ready[name] = compiled
        return out

    return first


def _failures() -> tuple[type[Exception], ...]:
    """What comes where numba is broken or switched off, or nothing can be kept."""
    common = (ImportError, OSError, RuntimeError)
    errors = sys.modules.get("numba.core.errors")
    return common if errors is None else (*common, errors.NumbaError)


@contextmanager
def _made(folder: Path) -> Iterator[Path]:
    """A place for a function's code: its folder once it is whole, if no other was first."""
    folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    place = Path(tempfile.mkdtemp(prefix=f"{folder.name}.", dir=folder.parent))
    try:
        yield place
        with suppress(OSError):  # another process was first; a full disk
            (place / DIGESTS).write_bytes(_digests(place))
            place.rename(folder)
    finally:
        shutil.rmtree(place, ignore_errors=True)


def _compile(function: Run, folder: Path) -> Run:
    """The function for numba, whose code is kept in a folder."""
    import numba

    _register()
    config: Any = numba.config
    if config.DISABLE_JIT:
        raise RuntimeError("NUMBA_DISABLE_JIT is set")
    usual, config.CACHE_DIR = config.CACHE_DIR, str(folder)
    try:
        return numba.njit(cache=True, error_model="numpy")(function)
    finally:
        config.CACHE_DIR = usual


@cache
def _register() -> None:
    """Tell numba that compiled code may call the functions of the search, and its arrays."""
    from numba.extending import overload, register_jitable

    from cam_rig.dynamics.events import arrays

    special: dict[Any, Any] = {
        rows.zeros: lambda count: arrays.zeros,
        rows.zero_rows: lambda count, size: arrays.zero_rows,
        rows.binomials: lambda degree: arrays.binomials,
        rows.borrowed: lambda table: arrays.borrowed,
    }
    for function, other in special.items():
        overload(function, strict=False)(other)
    for name in MODULES:
        module = importlib.import_module(f"cam_rig.{name}")
        for function in vars(module).values():
            own = isfunction(function) and function.__module__ == module.__name__
            if own and function not in special:
                register_jitable(error_model="numpy", no_cfunc_wrapper=True)(function)


@cache
def cache_folder() -> Path:
    """Where code is kept: of these sources and their place, libraries, CPU, and this user alone."""
    stamp = hashlib.sha256(__file__.encode())
    for name in (*MODULES, "dynamics.events.arrays"):
        path = Path(__file__).parents[2].joinpath(*name.split(".")).with_suffix(".py")
        stamp.update(path.read_bytes())
    for library in ("numba", "llvmlite", "numpy"):
        stamp.update(f"{library} {version(library)} ".encode())
    stamp.update(f"{sys.version} {platform.machine()} {_cpu()}".encode())
    return _base() / f"events-{stamp.hexdigest()[:16]}"


def _cpu() -> str:
    """What a CPU can do, as Linux says it; numba itself looks again."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return ""
    return "".join(next((x for x in lines if x.startswith(k)), "") for k in ("model name", "flags"))


def _base() -> Path:
    """A folder that can be written: the user's cache, or one that is gone with the process."""
    given = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        folder = (Path(given) if given else Path.home() / ".cache") / "cam_rig"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except (OSError, RuntimeError):  # it cannot be written; there is no home
        folder = Path(tempfile.mkdtemp(prefix="cam_rig-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        return folder


T = TypeVar("T")


def call(function: Callable[..., T], table: Callable[[bool], Any], *arguments: Any) -> T:
    """A function of the search, of a table and plain numbers, in plain Python or compiled."""
    run, arrays = form_of(function)
    out: T = run(table(arrays), *arguments)
    return out
