"""Backend of the searches for lift-offs and landings: compiled code, or plain Python.

A kernel is a function that either backend can run. `cam_rig.dynamics.events.compiler` compiles all
kernels once, in advance, into one extension module in a folder of the user's cache. Loading it
takes 4 ms and does not import numba. Without it kernels run in plain Python, until a
process has spent `BUILD_AFTER_S` in them. Then it is built. The environment variable
``CAM_RIG_EVENTS`` selects one backend for all calls. Both backends give bit-identical results.

The name of the folder contains a digest of the sources and the version of numpy, so that code is
compiled again when one of them changes. The code is for any processor of the machine's
architecture.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import sysconfig
import time
from collections.abc import Callable
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from importlib.util import find_spec, module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from cam_rig.errors import ConfigError
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
#: Further modules whose sources determine the compiled code, as paths relative to ``cam_rig``.
OTHER_SOURCES = ("units", "dynamics.velocity_jumps", "dynamics.events.compiler")
#: Time (s) that a process spends in kernels in plain Python before missing compiled code is built.
#: The build takes as long, and later processes use its result.
BUILD_AFTER_S = 60.0
#: Environment variable that selects the backend of the event search.
VARIABLE = "CAM_RIG_EVENTS"
#: Value of `VARIABLE` that selects plain Python for all calls.
PLAIN = "plain"
#: Value of `VARIABLE` that selects compiled code from the first call on, and builds it if needed.
COMPILED = "compiled"
#: Start of the names of the folders of builds in the cache.
BUILD_PREFIX = ".build-"
#: Name of the extension module with the compiled kernels.
LIBRARY = "cam_rig_kernels"

#: Function of the event search that plain Python and numba can both run.
Kernel = Callable[..., Any]


def new_state() -> SimpleNamespace:
    """Return the state of the backend in a process that has not called a kernel yet.

    ``library`` is the extension module, or None. ``plain_s`` is the time (s) spent in kernels in
    plain Python. ``has_loaded`` and ``has_built`` are True after the only attempt to do so.
    """
    return SimpleNamespace(library=None, plain_s=0.0, has_loaded=False, has_built=False)


_state = new_state()


def dispatch(kernel: Kernel, *arguments: Any) -> Any:
    """Call a function with the selected backend, compiled code or plain Python.

    Returns the result of ``kernel(*arguments)``, which is the same with both backends.
    """
    requested = os.environ.get(VARIABLE, "")
    if requested not in ("", PLAIN, COMPILED):
        raise ConfigError(f"{VARIABLE} must be {PLAIN} or {COMPILED}, got {requested!r}")
    if requested != PLAIN and (library := _library(requested == COMPILED)) is not None:
        return getattr(library, kernel.__name__)(*arguments)
    start = time.perf_counter()
    try:
        return kernel(*arguments)
    finally:
        _state.plain_s += time.perf_counter() - start


def _library(is_requested: bool) -> ModuleType | None:
    """Return the compiled kernels, or None if plain Python is to be used.

    If they are missing, they are built if ``is_requested`` is True or plain Python has taken long.
    """
    if not _state.has_loaded:
        _state.has_loaded = True
        _load_or_report()
    is_due = is_requested or _state.plain_s >= BUILD_AFTER_S
    if _state.library is None and is_due and not _state.has_built:
        _state.has_built = True
        if build():
            _load_or_report()
    return _state.library  # type: ignore[no-any-return]


def _load_or_report() -> None:
    """Load the compiled kernels, or report why they cannot be loaded.

    The cause is for example a folder that cannot be read, or without the right to execute. The user
    may have no folder for a cache, which is a RuntimeError.
    """
    try:
        _state.library = load()
    except (ImportError, OSError, RuntimeError) as error:
        _state.has_built = True  # another file would not load either
        _print(f"using plain Python, because the compiled code cannot be loaded ({error})")


def load() -> ModuleType | None:
    """Return the compiled kernels from the user's cache, or None if they are not there.

    A damaged file is removed, because loading it could end the process.
    """
    for path in cache_folder().glob(f"{LIBRARY}-*"):
        if path.name != library_name(path.read_bytes()):
            _print("removing the compiled code from the cache, because it is damaged")
            path.unlink(missing_ok=True)
            continue
        loader = ExtensionFileLoader(LIBRARY, str(path))
        spec = spec_from_loader(LIBRARY, loader)
        assert spec is not None
        library = module_from_spec(spec)
        loader.exec_module(library)
        return library
    return None


def library_name(content: bytes) -> str:
    """Return the file name of the extension module, with a digest of its content."""
    return f"{LIBRARY}-{hashlib.sha256(content).hexdigest()[:16]}{EXTENSION_SUFFIXES[0]}"


def build() -> bool:
    """Build the extension module in another process, and store it in the user's cache.

    The other process can be interrupted, which a compilation in this process cannot. Returns False
    if it failed, after a report of the reason on stderr.
    """
    import subprocess
    from tempfile import TemporaryDirectory

    if reason := _missing_tool():
        _print(f"using plain Python, because {reason}")
        return False
    _print("compiling, once (about a minute)")
    try:
        cache_folder().mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=BUILD_PREFIX, dir=cache_folder()) as folder:
            subprocess.run(
                [sys.executable, "-m", "cam_rig.dynamics.events.compiler", folder],
                check=True,
                env=os.environ | {VARIABLE: PLAIN, "TMPDIR": folder},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
            )
    except subprocess.CalledProcessError as error:
        lines = error.stderr.strip().splitlines()
        _print(f"using plain Python, because the compiler failed ({lines[-1] if lines else error})")
        return False
    except OSError as error:
        _print(f"using plain Python, because nothing can be compiled ({error})")
        return False
    return True


def _missing_tool() -> str:
    """Return why nothing can be compiled, or an empty text."""
    compiler = (os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc").split()[0]
    if find_spec("numba") is None:
        return "numba is not installed (pip install 'cam_rig[fast]')"
    return "" if shutil.which(compiler) else f"there is no C compiler ({compiler})"


def _print(message: str) -> None:
    print(f"events: {message}", file=sys.stderr)


@cache
def cache_folder() -> Path:
    """Return the folder of the compiled code in the user's cache.

    Its name contains a digest of the source files and of the version of numpy.
    """
    package = Path(vectors.__file__).parents[1]
    paths = [package / f"{name.replace('.', '/')}.py" for name in (*MODULES, *OTHER_SOURCES)]
    sources = b"".join(map(Path.read_bytes, paths)) + np.__version__.encode()
    digest = hashlib.sha256(sources).hexdigest()[:16]
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(base).expanduser() / "cam_rig" / f"events-{digest}"
