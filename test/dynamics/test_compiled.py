"""Plain Python and the compiled search give the same bits, and whatever breaks, plain goes on."""

import math
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerParameters, Interval, two_mass
from cam_rig.dynamics.events import arrays
from cam_rig.dynamics.events import search as compiled
from cam_rig.dynamics.events.runs import run_events
from cam_rig.dynamics.events.search import ALWAYS, PLAIN, VARIABLE, cache_folder, form_of
from cam_rig.dynamics.free_masses import TwoMassParameters, free_masses
from cam_rig.dynamics.jump.jump_speed import rigid_jump
from cam_rig.dynamics.jump.search import force_run
from cam_rig.dynamics.turn_map import StroboscopicMap
from cam_rig.dynamics.two_mass import Separation, first_lift_off
from cam_rig.laws import Law, rows
from cam_rig.units import NS, RPM, TURN

from .helpers import ONE, TWO

#: One turn in compiled code of its own process, and what it found.
RUN = """
from cam_rig.dynamics import FollowerParameters, Interval, MODELS
import cam_rig
law = cam_rig.build_law(cam_rig.load_cam("tm21"))
p = FollowerParameters(1.3, 4030.0, 8.642, 12.753, 3.3e8, 0.5)
interval = Interval(0, 200_000_000, 0.0, 40.0)
_, block = MODELS["one_mass"].advance(law, p, None, interval, 1000)
print([(event.kind, event.time.hex()) for event in block.events])
import sys
print("numba" in sys.modules)
"""


def bumpy(rng):
    """A cubic law of random pieces, C¹, whose velocity may jump at one joint."""
    count = int(rng.integers(2, 30))
    breaks = np.array([0.0, *np.sort(rng.uniform(0.1, TURN - 0.1, count - 1)), TURN])
    points = 0.01 * rng.standard_normal(count)
    ends, third = np.roll(points, -1), np.zeros(count)
    law = np.stack([points, points + third, ends, ends])
    if rng.uniform() < 0.3:
        law[1, 0] += 0.005
    return Law("bumpy", breaks, law)


def random_runs(laws, seed):
    """A law, both models' numbers, and an interval, at any speed, steady or on a ramp."""
    rng = np.random.default_rng(seed)
    names = ["poly345", "tm21", "bezier15", "cycloidal"]
    law = bumpy(rng) if seed % 3 == 0 else laws[names[int(rng.integers(len(names)))]]
    rate = math.sqrt(4030.0 / 1.3)
    damping = [0.0, 8.642, 2.0 * 1.3 * rate, 1e4][int(rng.integers(4))]
    restitution = [0.0, 0.5, 0.9][int(rng.integers(3))]
    one = replace(ONE, damping=damping, restitution=restitution)
    stem = [1.26e6, 3.3e8, 8000.0][int(rng.integers(3))]
    two = replace(
        TWO, stem_stiffness=stem, stem_damping=damping, damping=damping, restitution=restitution
    )
    rpm = 10.0 ** rng.uniform(-1.0, 4.3) if seed % 4 == 0 else rng.uniform(300.0, 800.0)
    speed, angle = rpm * RPM, float(rng.uniform(0.0, 1e5 * TURN))
    acceleration = float(rng.uniform(0.0, 0.2)) * speed**2 if seed % 5 == 0 else 0.0
    length = round(0.7 * TURN / speed * NS)
    return law, one, two, Interval(0, length, angle, speed, acceleration)


@pytest.mark.variants(4)
@pytest.mark.parametrize("seed", range(24))
def test_the_bits_are_the_same(laws, monkeypatch, seed):
    """Events, samples and the state at the end of both models."""
    law, one, two, interval = random_runs(laws, seed)
    for model, p in (("one_mass", one), ("two_mass", two)):
        found = []
        for form in (PLAIN, ALWAYS):
            monkeypatch.setenv(VARIABLE, form)
            found.append(MODELS[model].advance(law, p, None, interval, 1000))
        (end, block), (other_end, other_block) = found
        assert block.events == other_block.events
        assert end == other_end
        assert np.array_equal(block.rows, other_block.rows)


def test_masses_too_much_alike(laws, monkeypatch):
    """Where the motions have no pairs it goes by the exponential: the same bits, the same times."""
    p, found = replace(TWO, restitution=0.5), []
    unpaired = replace(free_masses(p), pairs=None)
    for system, form in ((free_masses(p), PLAIN), (unpaired, PLAIN), (unpaired, ALWAYS)):
        monkeypatch.setenv(VARIABLE, form)
        monkeypatch.setattr(two_mass, "free_masses", lambda _, system=system: system)
        course = Separation(laws["poly345"], p, 450.0 * RPM)
        course.run(0.2)
        found.append(course.events)
    paired, plain, whole = found
    assert plain == whole
    assert len(plain) > 4
    times = [[event.time for event in events] for events in (paired, plain)]
    assert times[0] == pytest.approx(times[1], abs=1e-12)


@pytest.mark.parametrize("kind", [int, np.float32, Fraction])
def test_a_number_of_any_kind(laws, monkeypatch, kind):
    """Whole numbers and fractions: the same bits as floats, and nothing is compiled once more."""
    monkeypatch.setenv(VARIABLE, ALWAYS)
    law, found = laws["poly345"], []
    for number in (float, kind):
        one = FollowerParameters(*map(number, (2, 4096, 8, 16, 2**28, 0)))
        two = TwoMassParameters(*map(number, (1, 1, 2**20, 4096, 2, 8, 16, 0)))
        assert all(type(value) is float for p in (one, two) for value in vars(p).values())
        speed, angle, limit = map(number, (64, 1, 1))
        interval = Interval(0, NS // 4, angle, speed)
        _, block = MODELS["one_mass"].advance(law, one, None, interval, 1000)
        course = Separation(law, two, speed, angle)
        course.run(limit)
        turns = [StroboscopicMap(law, p, speed).run(3).states.tolist() for p in (one, two)]
        loss = first_lift_off(law, two, speed, np.zeros(2), limit)
        least = force_run(law, two, 0.1).lowest(speed)
        found.append((block.events, course.events, turns, loss, least, rigid_jump(law, one)))
    assert found[0] == found[1]
    assert len(course.events) > 4
    compiled_ones = [run for run in compiled._ready.values() if hasattr(run, "signatures")]
    assert {len(run.signatures) for run in compiled_ones} == {1}


def test_a_loss_of_contact_alone(laws, monkeypatch):
    """As the jump speed's search asks for it; with the same bits."""
    found = []
    for form in (PLAIN, ALWAYS):
        monkeypatch.setenv(VARIABLE, form)
        found.append(first_lift_off(laws["poly345"], TWO, 450.0 * RPM, np.zeros(2), 1.0))
    assert found[0] == found[1] is not None


def test_binomials_beyond_the_table():
    """A law of a high degree goes by a recurrence; both forms have the same one."""
    table = len(rows.PASCAL)
    for degree in (3, table - 1, table, table + 9):
        assert rows.binomials(degree)[2] == math.comb(degree, 2)
    assert arrays.PASCAL[table - 1].tolist() == rows.PASCAL[-1]


def test_plain_python_until_it_pays(monkeypatch):
    """A first event imports nothing; code that is kept is loaded sooner than one is compiled."""
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr(compiled, "_ready", {})
    monkeypatch.setattr(compiled, "_is_kept", lambda _: False)
    monkeypatch.setattr(compiled, "_prepared", lambda function: function)
    for seconds, kept, expected in (
        (0.0, True, False),
        (1.0, False, False),
        (1.0, True, True),
        (20.0, False, True),
    ):
        monkeypatch.setattr(compiled.SPENT, "seconds", seconds)
        monkeypatch.setattr(compiled, "_is_kept", lambda _, kept=kept: kept)
        compiled._ready.clear()
        assert form_of(run_events)[1] == expected
    monkeypatch.setattr(compiled, "_installed", lambda: False)
    assert not form_of(run_events)[1]


def run(**environment):
    """The standard streams of `RUN` in a process of its own."""
    own = {k: v for k, v in os.environ.items() if k not in (VARIABLE, "NUMBA_CACHE_DIR")}
    done = subprocess.run(
        [sys.executable, "-c", RUN],
        capture_output=True,
        text=True,
        check=True,
        env=own | environment,
        cwd=Path(__file__).parents[2],
        timeout=100,
    )
    return done.stdout.splitlines(), done.stderr


def test_a_few_events_need_no_numba(tmp_path):
    """Asked for, what is kept is loaded: the same events, and nothing is said."""
    (events, numba), words = run()
    assert (numba, words) == ("False", "")
    shutil.copytree(cache_folder(), tmp_path / "cam_rig" / cache_folder().name)
    (kept, loaded), words = run(XDG_CACHE_HOME=str(tmp_path), **{VARIABLE: ALWAYS})
    assert (kept, loaded, words) == (events, "True", "")


def triple(value):
    """What stands for the search where it is compiled often."""
    return 3.0 * value


def loaded(value):
    """What the compiled `triple` gives, as a new process would come by it."""
    compiled._ready.clear()
    compiled._is_kept.cache_clear()
    return form_of(triple)[0](value)


def damage(path, rng):
    """One flipped bit of a file, or its end cut off, or all of it gone."""
    data = bytearray(path.read_bytes())
    kind = rng.integers(10)
    if kind == 0:
        return path.unlink()
    if kind == 1:
        return path.write_bytes(data[: rng.integers(len(data))])
    data[rng.integers(len(data))] ^= 1 << rng.integers(8)
    return path.write_bytes(data)


@pytest.fixture
def kept(monkeypatch, tmp_path):
    """The folder of the code of `triple`, compiled in this test."""
    monkeypatch.setenv(VARIABLE, ALWAYS)
    monkeypatch.setattr(compiled, "_ready", {})
    monkeypatch.setattr(compiled, "cache_folder", lambda: tmp_path)
    assert loaded(2.0) == 6.0
    yield tmp_path / "triple"
    compiled._is_kept.cache_clear()


def test_damaged_code_is_never_loaded(kept, capsys):
    """Whatever was done to its files: it is removed and made anew, and said once; seeded."""
    rng = np.random.default_rng(1)
    for _ in range(12):
        files = sorted(path for path in kept.rglob("*") if path.is_file())
        assert len(files) == 3  # numba's index and code, and the digests
        damage(files[rng.integers(len(files))], rng)
        compiled._is_kept.cache_clear()
        assert not compiled._is_kept(triple)  # before numba would read it in this process
        assert capsys.readouterr().err.count("is damaged") == 1
        assert loaded(2.0) == 6.0
        assert capsys.readouterr().err.count("compiling") == 1
        assert loaded(2.0) == 6.0
        assert capsys.readouterr().err == ""


def test_where_numba_does_not_work(monkeypatch, tmp_path, capsys):
    """Switched off, or without a place for its code: plain Python, and it is said once."""
    monkeypatch.setenv(VARIABLE, ALWAYS)
    monkeypatch.setattr(compiled, "cache_folder", lambda: tmp_path / "file" / "below")
    (tmp_path / "file").touch()
    for disabled, told in ((False, "NotADirectoryError"), (True, "NUMBA_DISABLE_JIT is set")):
        monkeypatch.setattr(compiled, "_ready", {})
        if disabled:
            monkeypatch.setattr(compiled, "cache_folder", lambda: tmp_path)
            monkeypatch.setattr("numba.config.DISABLE_JIT", 1)
        assert loaded(2.0) == 6.0
        words = capsys.readouterr().err
        assert re.search(rf"plain Python is used, for numba does not work \(.*{told}", words)
        assert not form_of(triple)[1]
    compiled._is_kept.cache_clear()


def test_two_compile_at_once(kept, capsys):
    """The first one's code stays; one that is killed, or fails, leaves nothing that is loaded."""
    before = (kept / compiled.DIGESTS).read_bytes()
    with compiled._made(kept) as other:
        (other / "x.nbi").write_bytes(b"another")
    assert (kept / compiled.DIGESTS).read_bytes() == before
    shutil.rmtree(kept)
    with pytest.raises(KeyboardInterrupt), compiled._made(kept) as cut:
        (cut / "x.nbi").write_bytes(b"half")
        raise KeyboardInterrupt
    assert list(kept.parent.iterdir()) == []
    cut.mkdir()  # as SIGKILL leaves it
    (cut / "x.nbi").write_bytes(b"half")
    capsys.readouterr()
    assert loaded(2.0) == 6.0
    assert "damaged" not in capsys.readouterr().err


def test_a_place_that_cannot_be_written(monkeypatch, tmp_path):
    """Without one for the user, code is kept in a folder that is gone with the process."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert compiled._base() == tmp_path / "cam_rig"
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert compiled._base().is_dir()
    assert tmp_path not in compiled._base().parents
