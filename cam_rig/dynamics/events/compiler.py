"""Compiler of the kernels: all of them as one extension module, by numba.

`cam_rig.dynamics.events.backend` starts this module as a program. A C compiler and the headers of
Python are needed. numba warns that numba.pycc, its compiler of extension modules, will be replaced
by a successor, without a date.

Usage: ``python -m cam_rig.dynamics.events.compiler FOLDER`` with an empty folder in the cache.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from inspect import isfunction
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np

from cam_rig.dynamics import turn_map, two_mass
from cam_rig.dynamics.events import backend, trajectory
from cam_rig.dynamics.events.backend import (
    BUILD_PREFIX,
    LIBRARY,
    MODULES,
    Kernel,
    cache_folder,
    library_name,
    load,
)
from cam_rig.dynamics.free_masses import TwoMassParameters
from cam_rig.dynamics.interval import Interval
from cam_rig.dynamics.jump import rigid_mass
from cam_rig.dynamics.jump.two_masses import find_two_mass_jump, force_run
from cam_rig.dynamics.modal import run
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.laws import Law, vectors
from cam_rig.units import NS, TURN

#: Time (s) between two checks if the process that started this one is running.
PARENT_PERIOD_S = 0.5
#: Modules that call kernels.
CALLERS = (trajectory, rigid_mass, run, turn_map, two_mass)


@contextmanager
def recorder(record: Callable[[Kernel, tuple[Any, ...]], object]) -> Iterator[None]:
    """Run kernels in plain Python in this context, and pass each of their calls to ``record``."""

    def dispatch(kernel: Kernel, *arguments: Any) -> Any:
        record(kernel, arguments)
        return kernel(*arguments)

    try:
        for module in CALLERS:
            module.dispatch = dispatch  # type: ignore[attr-defined]
        yield
    finally:
        for module in CALLERS:
            module.dispatch = backend.dispatch  # type: ignore[attr-defined]


def collect_calls() -> dict[Kernel, tuple[Any, ...]]:
    """Return the arguments of a call of each kernel, which determine the types to compile for.

    Each follower model does a short run in plain Python.
    """
    calls: dict[Kernel, tuple[Any, ...]] = {}
    ordinates = np.array([[0.0, 0.01], [0.0, 0.01], [0.01, 0.0], [0.01, 0.0]])
    law = Law("smoothstep", np.array([0.0, 0.5 * TURN, TURN]), ordinates)
    one_mass = FollowerParameters(1.0, 1e3, 1.0, 1.0, 1e8)
    two_masses = TwoMassParameters(0.5, 0.5, 1e6, 1e3, 1.0, 1.0, 1.0)
    with recorder(calls.setdefault):
        OneMassTrajectory(law, one_mass, Interval(0, NS // 10, 0.0, 60.0)).run(None)
        two_mass.Separation(law, two_masses, 60.0).run(0.1)
        for follower in (one_mass, two_masses):
            turn_map.StroboscopicMap(law, follower, 60.0).run(1)
        two_mass.first_lift_off(law, two_masses, 60.0, np.zeros(2), 0.1)
        force_run(law, two_masses, 0.1).min_output(60.0)
        find_two_mass_jump(law, two_masses, 0.1)
        rigid_mass.rigid_jump(law, one_mass)
    return calls


def compile_kernels(folder: Path) -> Path:
    """Compile all kernels into an extension module in ``folder``, and return its path."""
    numba: Any = import_module("numba")
    warnings.simplefilter("ignore", numba.core.errors.NumbaPendingDeprecationWarning)
    extension: Any = import_module("numba.pycc").CC(LIBRARY)
    extension.output_dir = str(folder)
    calls = collect_calls()
    register()
    for kernel, arguments in calls.items():
        types = tuple(map(numba.typeof, arguments))
        extension.export(kernel.__name__, types)(exported(kernel, len(arguments)))
    extension.compile()
    return folder / str(extension.output_file)


def exported(kernel: Kernel, count: int) -> Kernel:
    """Return a function that calls a kernel with ``count`` arguments.

    numba compiles an exported function with checks for division by zero. A kernel that it calls is
    compiled without them, as it runs in plain Python.
    """
    names, scope = ", ".join(f"x{i}" for i in range(count)), dict[str, Any](kernel=kernel)
    exec(f"def call({names}): return kernel({names})", scope)
    function: Kernel = scope["call"]
    return function


def register() -> None:
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


def main() -> None:
    """Compile the kernels and store them in the user's cache, unless another process did so."""
    Thread(target=_end_with_parent, args=(os.getppid(),), daemon=True).start()
    folder = Path(sys.argv[1])
    with Path(cache_folder() / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        for path in cache_folder().glob(f"{BUILD_PREFIX}*"):
            # The folders of waiting processes are empty. The others are of killed processes.
            if path != folder and any(path.iterdir()):
                shutil.rmtree(path, ignore_errors=True)
        if load() is None:
            built = compile_kernels(folder)
            built.replace(cache_folder() / library_name(built.read_bytes()))


def _end_with_parent(parent: int) -> None:
    """End this process when the process that started it has ended."""
    while os.getppid() == parent:
        time.sleep(PARENT_PERIOD_S)
    os._exit(1)


if __name__ == "__main__":
    main()
