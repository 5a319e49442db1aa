"""Tests of the two backends of the simulation, plain Python and compiled code.

Their results are equal to the last bit.
"""

import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerParameters, Interval, two_mass
from cam_rig.dynamics.events import backend, compiler
from cam_rig.dynamics.events.backend import COMPILED, PLAIN, VARIABLE
from cam_rig.dynamics.free_masses import TwoMassParameters, free_masses
from cam_rig.dynamics.jump.rigid_mass import rigid_jump
from cam_rig.dynamics.jump.two_masses import find_two_mass_jump, force_run
from cam_rig.dynamics.turn_map import StroboscopicMap
from cam_rig.dynamics.two_mass import Separation, first_lift_off
from cam_rig.errors import ConfigError
from cam_rig.laws import Law, vectors
from cam_rig.units import NS, RPM, TURN

from .helpers import ONE, TWO

#: Folder of the compiled kernels in the user's cache.
REAL_CACHE = backend.cache_folder()


def bumpy(rng):
    """Return a random C¹ motion law of cubics.

    In three of ten cases it has a velocity jump.
    """
    count = int(rng.integers(2, 30))
    breaks = np.array([0.0, *np.sort(rng.uniform(0.1, TURN - 0.1, count - 1)), TURN])
    points = 0.01 * rng.standard_normal(count)
    ends, third = np.roll(points, -1), np.zeros(count)
    law = np.stack([points, points + third, ends, ends])
    if rng.uniform() < 0.3:
        law[1, 0] += 0.005
    return Law("bumpy", breaks, law)


def random_runs(laws, seed):
    """Return a random law, parameters of one and of two masses, and an interval.

    The speed of the interval is constant or a ramp.
    """
    rng = np.random.default_rng(seed)
    names = ["poly345", "tm21", "bezier15", "cycloidal"]
    law = bumpy(rng) if seed % 3 == 0 else laws[names[int(rng.integers(len(names)))]]
    rate = math.sqrt(4030.0 / 1.3)
    damping = [0.0, 8.642, 2.0 * 1.3 * rate, 1e4][int(rng.integers(4))]
    restitution = [0.0, 0.5, 0.9][int(rng.integers(3))]
    one = replace(ONE, damping=damping, restitution=restitution)
    stem = [1.26e6, 3.3e8, 8000.0][int(rng.integers(3))]
    numbers = {"damping": damping, "stem_damping": damping, "restitution": restitution}
    two = replace(TWO, stem_stiffness=stem, **numbers)
    rpm = 10.0 ** rng.uniform(-1.0, 4.3) if seed % 4 == 0 else rng.uniform(300.0, 800.0)
    speed, angle = rpm * RPM, float(rng.uniform(0.0, 1e5 * TURN))
    acceleration = float(rng.uniform(0.0, 0.2)) * speed**2 if seed % 5 == 0 else 0.0
    length = round(0.7 * TURN / speed * NS)
    return law, one, two, Interval(0, length, angle, speed, acceleration)


@pytest.mark.variants(4)
@pytest.mark.parametrize("seed", range(24))
def test_both_backends_return_the_same_bits(laws, monkeypatch, seed):
    """Events, samples and end states of both backends are equal bit by bit.

    An event is a lift-off or a landing.
    """
    law, one, two, interval = random_runs(laws, seed)
    for model, p in (("one_mass", one), ("two_mass", two)):
        results = []
        for value in (PLAIN, COMPILED):
            monkeypatch.setenv(VARIABLE, value)
            results.append(MODELS[model].advance(law, p, None, interval, 1000))
        (end, block), (compiled_end, compiled_block) = results
        assert block.events == compiled_block.events
        assert end == compiled_end
        assert np.array_equal(block.rows, compiled_block.rows)


def test_masses_without_pairs(laws, monkeypatch):
    """Free motion by the matrix exponential gives the same events as by eigenvectors.

    It is used if the free masses have no pairs of eigenvectors. The times agree within 1e-12 s.
    """
    p, runs = replace(TWO, restitution=0.5), []
    unpaired = replace(free_masses(p), pairs=None)
    for system, value in ((free_masses(p), PLAIN), (unpaired, PLAIN), (unpaired, COMPILED)):
        monkeypatch.setenv(VARIABLE, value)
        monkeypatch.setattr(two_mass, "free_masses", lambda _, system=system: system)
        trajectory = Separation(laws["poly345"], p, 450.0 * RPM)
        trajectory.run(0.2)
        runs.append(trajectory.events)
    paired, plain, compiled = runs
    assert plain == compiled
    assert len(plain) > 4
    times = [[event.time for event in events] for events in (paired, plain)]
    assert times[0] == pytest.approx(times[1], abs=1e-12)


@pytest.mark.parametrize("kind", [int, np.float32, Fraction])
def test_a_number_of_any_kind(laws, monkeypatch, kind):
    """Integers, fractions and numpy floats give the results of Python floats.

    The results are equal bit by bit.
    """
    monkeypatch.setenv(VARIABLE, COMPILED)
    law, results = laws["poly345"], []
    for number in (float, kind):
        one = FollowerParameters(*map(number, (2, 4096, 8, 16, 2**28, 0)))
        two = TwoMassParameters(*map(number, (1, 1, 2**20, 4096, 2, 8, 16, 0)))
        assert all(type(value) is float for p in (one, two) for value in vars(p).values())
        speed, angle, limit = map(number, (64, 1, 1))
        interval = Interval(0, NS // 4, angle, speed)
        _, block = MODELS["one_mass"].advance(law, one, None, interval, 1000)
        trajectory = Separation(law, two, speed, angle)
        trajectory.run(limit)
        turns = [StroboscopicMap(law, p, speed).run(3).states.tolist() for p in (one, two)]
        loss = first_lift_off(law, two, speed, np.zeros(2), limit)
        min_force = force_run(law, two, 0.1).min_output(speed)
        jump = rigid_jump(law, one)
        results.append((block.events, trajectory.events, turns, loss, min_force, jump))
    assert results[0] == results[1]
    assert len(trajectory.events) > 4


def test_binomials_beyond_the_table():
    """Binomial coefficients of a degree beyond the stored table are correct.

    They are computed by a recurrence.
    """
    for degree in (3, len(vectors.PASCAL) - 1, len(vectors.PASCAL), len(vectors.PASCAL) + 9):
        assert vectors.binomials(degree)[2] == math.comb(degree, 2)


def test_every_call_has_the_compiled_types(laws):
    """Every kernel is always called with the types of arguments for which it is compiled.

    A compiled kernel does not check them.
    """
    from numba import typeof

    expected = {
        kernel: {tuple(map(typeof, arguments))}
        for kernel, arguments in compiler.collect_calls().items()
    }
    calls = {kernel: set() for kernel in expected}
    with compiler.recorder(lambda kernel, x: calls[kernel].add(tuple(map(typeof, x)))):
        for seed in range(10):
            law, one, two, interval = random_runs(laws, seed)
            for model, p in (("one_mass", one), ("two_mass", two)):
                MODELS[model].advance(law, p, None, interval, 1000)
            if not law.velocity_jumps:
                StroboscopicMap(law, one, interval.speed).run(1)
                StroboscopicMap(law, TWO, 50.0).run(1)
                first_lift_off(law, two, interval.speed, np.zeros(2), 0.01)
                force_run(law, two, 0.01).min_output(interval.speed)
                rigid_jump(law, one)
        find_two_mass_jump(laws["poly345"], TWO, 0.1)
    assert calls == expected


@pytest.fixture
def process(laws, monkeypatch, tmp_path):
    """Start of a process in which no kernel has been called, with an empty folder of the cache."""
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr(backend, "cache_folder", lambda: tmp_path)

    def restart():
        monkeypatch.setattr(backend, "_state", backend.new_state())
        return rigid_jump(laws["poly345"], ONE)

    return restart


def store_library(folder, content=None):
    """Store the compiled kernels of the user's cache in a folder, as its build does."""
    if content is None:
        (library,) = REAL_CACHE.glob(f"{backend.LIBRARY}-*")
        content = library.read_bytes()
    (folder / backend.library_name(content)).write_bytes(content)


def test_compiled_code_is_used_from_the_first_call(process, tmp_path, monkeypatch):
    """A process loads compiled code at its first call, unless plain Python is requested."""
    plain = process()
    assert backend._state.library is None
    store_library(tmp_path)
    assert process() == plain
    assert backend._state.library is not None
    monkeypatch.setenv(VARIABLE, PLAIN)
    assert process() == plain
    assert backend._state.library is None


@pytest.mark.parametrize("requested", [True, False])
def test_missing_code_is_built_once(laws, process, tmp_path, monkeypatch, requested):
    """Missing code is built on request, or after a minute in plain Python, once per process."""
    builds = []

    def build():
        builds.append(store_library(tmp_path))
        return True

    monkeypatch.setattr(backend, "build", build)
    process()
    assert not builds
    if requested:
        monkeypatch.setenv(VARIABLE, COMPILED)
    else:
        backend._state.plain_s = backend.BUILD_AFTER_S
    for _ in range(2):
        rigid_jump(laws["poly345"], ONE)
    assert len(builds) == 1
    assert backend._state.library is not None


@pytest.mark.parametrize("damage", [lambda data: data[: len(data) // 2], lambda x: bytes(len(x))])
def test_damaged_code_is_removed(process, tmp_path, capsys, damage):
    """Damaged compiled code is reported in one line and removed. Plain Python is used."""
    expected = process()
    store_library(tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_bytes(damage(path.read_bytes()))
    assert process() == expected
    line = "events: removing the compiled code from the cache, because it is damaged\n"
    assert capsys.readouterr().err == line
    assert not list(tmp_path.iterdir())


def test_plain_python_if_the_code_cannot_be_loaded(process, monkeypatch, capsys, tmp_path):
    """If the compiled code is valid but cannot be loaded, the reason is printed once."""
    expected = process()
    store_library(tmp_path, b"no extension module")
    monkeypatch.setenv(VARIABLE, COMPILED)
    assert process() == expected
    line = capsys.readouterr().err
    assert line.startswith("events: using plain Python, because the compiled code cannot be loaded")
    assert line.count("\n") == 1


def test_plain_python_without_numba(process, monkeypatch, capsys):
    """Without numba, plain Python is used. The remedy is printed if compiled code is requested."""
    expected = process()
    monkeypatch.setenv(VARIABLE, COMPILED)
    monkeypatch.setattr(backend, "find_spec", lambda _: None)
    assert process() == expected
    line = (
        "events: using plain Python, because numba is not installed (pip install 'cam_rig[fast]')"
    )
    assert capsys.readouterr().err == f"{line}\n"


def test_plain_python_without_a_compiler(process, monkeypatch, capsys):
    """Without a C compiler, plain Python is used, and the compiler is named."""
    expected = process()
    monkeypatch.setenv(VARIABLE, COMPILED)
    monkeypatch.setenv("CC", "no_compiler -O2")
    assert process() == expected
    line = "events: using plain Python, because there is no C compiler (no_compiler)\n"
    assert capsys.readouterr().err == line


@pytest.mark.parametrize("broken", ["home", "directory", "after the build"])
def test_plain_python_if_the_cache_cannot_be_used(process, monkeypatch, capsys, tmp_path, broken):
    """A cache that cannot be used is reported in one line, and plain Python is used."""
    expected = process()
    monkeypatch.setenv(VARIABLE, COMPILED)
    if broken == "home":
        error = RuntimeError("Could not determine home directory.")
        monkeypatch.setattr(backend, "cache_folder", Mock(side_effect=error))
    elif broken == "directory":
        (tmp_path / f"{backend.LIBRARY}-x").mkdir()
    else:
        monkeypatch.setattr(backend, "build", lambda: store_library(tmp_path, b"x") is None)
    assert process() == expected
    line = capsys.readouterr().err
    assert line.startswith("events: using plain Python, because the compiled code cannot be loaded")
    assert line.count("\n") == 1


def test_an_unknown_backend_is_refused(process, monkeypatch):
    """A value of the environment variable that is not a backend is refused."""
    monkeypatch.setenv(VARIABLE, "Compiled")
    with pytest.raises(ConfigError, match="must be plain or compiled, got 'Compiled'"):
        process()


def test_plain_python_if_the_compiler_fails(process, monkeypatch, capsys, tmp_path):
    """If the compiler fails, the reason is printed in one line, and plain Python is used."""
    expected = process()
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))  # no lock can be made there
    monkeypatch.setenv(VARIABLE, COMPILED)
    assert process() == expected
    first, second = capsys.readouterr().err.splitlines()
    assert f"{first}\n" == COMPILES
    reason = "events: using plain Python, because the compiler failed (NotADirectoryError"
    assert second.startswith(reason)


#: Program that calls a kernel, and prints its result or "interrupted".
PROGRAM = """
import signal
import numpy as np
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.rigid_mass import rigid_jump
from cam_rig.laws import Law
from cam_rig.units import TURN
ordinates = np.array([[0.0, 0.01], [0.0, 0.01], [0.01, 0.0], [0.01, 0.0]])
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background shell ignores SIGINT
law = Law("smoothstep", np.array([0.0, 0.5 * TURN, TURN]), ordinates)
try:
    print(rigid_jump(law, FollowerParameters(1.0, 1e3, 1.0, 1.0, 1e8))[0].hex())
except KeyboardInterrupt:
    print("interrupted")
"""
#: Line on standard error of a process that builds the compiled code.
COMPILES = "events: compiling, once (about a minute)\n"


def start(folder):
    """Start `PROGRAM` with a folder for compiled code, and return the process.

    It is the program of this test module.
    """
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {VARIABLE: COMPILED, "NUMBA_CACHE_DIR": str(folder)},
        cwd=Path(__file__).parents[2],
    )


@pytest.mark.parametrize("delay", [0.3, pytest.param(20.0, marks=pytest.mark.long)])
def test_an_interrupt_while_compiling(tmp_path, delay):
    """Ctrl-C during the compilation raises KeyboardInterrupt in the caller.

    Nothing else is printed, and no file but an empty lock remains.
    """
    process = start(tmp_path)
    assert process.stderr.readline() == COMPILES
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    out, errors = process.communicate(timeout=60.0)
    assert (process.returncode, out, errors) == (0, "interrupted\n", "")
    assert all(path.name == "lock" for path in tmp_path.rglob("*") if path.is_file())


@pytest.mark.long
def test_two_processes_compile_at_once(tmp_path):
    """Two processes that compile at the same time both get the correct result.

    One of them compiles, and the other waits for it. A third process loads the code.
    """
    both = [start(tmp_path), start(tmp_path)]
    outputs = [process.communicate(timeout=300.0) for process in both]
    speed, errors = start(tmp_path).communicate(timeout=60.0)
    assert (float.fromhex(speed) > 0.0, errors) == (True, "")
    assert all(out == speed and errors in ("", COMPILES) for out, errors in outputs)
    assert len(list(tmp_path.rglob(f"{backend.LIBRARY}-*"))) == 1
