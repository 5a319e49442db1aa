"""Numbers of a rig from jump speeds."""

import re
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.errors import ConfigError
from cam_rig.measured.rig_fit import jump_fit
from cam_rig.measured.rig_fit.jump_fit import fit_jumps
from cam_rig.measured.rig_fit.jump_table import JumpReading, JumpTable
from cam_rig.units import RPM

OWN, DAMPING, PRELOAD = 1.1, 8.0, 25.0


def table(law, columns=("mass", "spring_stiffness"), noise=0.0, seed=0):
    """Readings of a follower with 1.1 kg of its own, 25 N and 8 N·s/m."""
    random = np.random.default_rng(seed)
    readings = []
    for line, (on, spring) in enumerate(
        [(m, k) for m in (0.0, 0.3, 0.9) for k in (2e3, 4e3, 9e3)], 2
    ):
        follower = FollowerParameters(OWN + on, spring, DAMPING, PRELOAD, 1e8)
        speed = find_jump(law, follower, None).rpm * RPM + noise * random.standard_normal()
        known = {"mass": on, "spring_stiffness": spring}
        readings.append(JumpReading(line, speed, {name: known[name] for name in columns}))
    return JumpTable("jumps.csv", tuple(readings), columns, ())


def values(fit):
    return {n.name: n.value for n in fit.numbers}


def test_exact_speeds_give_the_numbers_back(law, rig):
    """Nine speeds tell three numbers, to the rounding of a search."""
    found = values(fit_jumps(law, table(law), rig))
    assert found["mass"] == pytest.approx(OWN, rel=1e-4)
    assert found["preload"] == pytest.approx(PRELOAD, rel=1e-3)
    assert found["damping"] == pytest.approx(DAMPING, rel=1e-3)
    assert found["restitution"] is None


@pytest.mark.long
def test_intervals_hold_the_truth(law, rig):
    """Readings off by 0.5 rpm, said to be: 20 tables with damping given."""
    inside = 0
    for seed in range(10):
        read = table(law, noise=0.5 * RPM, seed=seed)
        fit = fit_jumps(law, read, rig, given={"damping": DAMPING}, error=0.5)
        for number, truth in ((fit.numbers[0], OWN), (fit.numbers[1], PRELOAD)):
            inside += abs(number.value - truth) < 1.96 * number.error
    assert inside >= 16


def test_without_masses_only_ratios_are_told(law, rig):
    """F = 0 is homogeneous in m, c, k and preload."""
    read = table(law, columns=("mass",))
    same = replace(read.readings[4], known={})
    one = replace(read, columns=(), readings=(same,) * 5)
    fit = fit_jumps(law, one, rig, error=1.0)
    assert all(n.value is None for n in fit.numbers)
    assert any("not identifiable apart" in words for words in fit.conclusions())


def test_too_few_readings_are_refused(law, rig):
    read = table(law)
    few = replace(read, readings=read.readings[:2])
    with pytest.raises(ConfigError, match=r"2 readings for 3 numbers.*needed: 4"):
        fit_jumps(law, few, rig)


@pytest.mark.long
def test_an_outlier_is_named(law, rig):
    """One reading 30 rpm off: its line."""
    read = table(law, noise=0.3 * RPM)
    wrong = list(read.readings)
    wrong[4] = replace(wrong[4], speed=wrong[4].speed + 30.0 * RPM)
    fit = fit_jumps(law, replace(read, readings=tuple(wrong)), rig, error=0.3)
    assert any("Line 6" in words for words in fit.conclusions())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        *(
            ({"speed": rpm * RPM}, rf"the jump speed is {re.escape(f'{rpm:g}')} rpm; allowed: from")
            for rpm in (1e308, 1.1e5, 0.5)
        ),
        (
            {"known": {"mass": 0.0, "spring_stiffness": 1e280}},
            r"spring_stiffness is 1e\+280 N/m; allowed",
        ),
    ],
)
def test_what_no_follower_has_is_refused(law, rig, change, words):
    """A speed that no jump has, a number beyond the limits: its line, the value, the limit."""
    read = table(law)
    wrong = (*read.readings[:-1], replace(read.readings[-1], **change))
    with pytest.raises(ConfigError, match=f"line 10: {words}"):
        fit_jumps(law, replace(read, readings=wrong), rig)


@pytest.mark.long
def test_equal_set_ups_are_solved_once(law, rig, monkeypatch):
    """A thousand readings of each of nine set-ups: as many solutions as of one of each.

    The numbers are those of all readings: of a set-up read twice, with the mean of both.
    """
    count = 0

    def counted(*arguments):
        nonlocal count
        count += 1
        return find_jump(*arguments)

    monkeypatch.setattr(jump_fit, "find_jump", counted)
    read = table(law, noise=0.5 * RPM)
    once = fit_jumps(law, read, rig, given={"damping": DAMPING})
    alone, count = count, 0
    both = [replace(r, speed=r.speed + d * RPM) for r in read.readings for d in (0.1, -0.1)]
    many = replace(read, readings=tuple(both * 500))
    fit = fit_jumps(law, many, rig, given={"damping": DAMPING})
    assert count < 1.5 * alone
    assert values(fit)["mass"] == pytest.approx(values(once)["mass"], rel=1e-5)
    assert values(fit)["preload"] == pytest.approx(values(once)["preload"], rel=1e-4)
