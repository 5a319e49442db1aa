"""Tests of the identification of a rig's follower from measured jump speeds.

The jump speed is the lowest cam speed with a loss of contact. A set-up is one combination of added
mass, spring and preload at which it is read.
"""

import math
from dataclasses import replace
from itertools import combinations, product

import numpy as np
import pytest

from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.errors import ConfigError
from cam_rig.laws import build_law
from cam_rig.studies.fit_rig.jumps import search as jump_search
from cam_rig.studies.fit_rig.jumps.fit import fit_jumps
from cam_rig.studies.fit_rig.jumps.table import JumpReading, JumpTable
from cam_rig.studies.fit_rig.parameters import build_follower
from cam_rig.units import RPM

from ...conftest import dwell, rise
from .machines import numbers_of

OWN_MASS, DAMPING, PRELOAD = 1.1, 8.0, 25.0
MACHINE = {"mass": OWN_MASS, "damping": DAMPING, "preload": PRELOAD, "restitution": 0.0}
#: Combinations of columns (varied quantities) that a table of jump speeds may have.
COLUMNS = [c for n in (3, 2) for c in combinations(("mass", "spring_stiffness", "preload"), n)]
#: Nine set-ups of the rig: three added masses (kg) with three springs (N/m).
SET_UPS = [{"mass": m, "spring_stiffness": k} for m in (0.0, 0.3, 0.9) for k in (2e3, 4e3, 9e3)]


def table_of(law, machine, set_ups):
    """Return the exact jump speeds of a follower as a table, and the jump angles.

    They are a `JumpTable` and angles in rad. `machine` has the parameters of the follower, and
    `set_ups` the added mass, spring or preload of each reading.
    """
    readings, angles = [], []
    for line, setup in enumerate(set_ups, 2):
        of = machine | setup | {"mass": machine["mass"] + setup.get("mass", 0.0)}
        jump = find_jump(law, build_follower(of, 1e8), None)
        readings.append(JumpReading(line, jump.speed, setup))
        angles.append(jump.angle)
    return JumpTable("jumps.csv", tuple(readings), tuple(set_ups[0]), ()), angles


def moved(read, by):
    """Return the table of jump speeds with an error (rpm) added to each."""
    off = zip(read.readings, by, strict=True)
    return replace(read, readings=tuple(replace(r, speed=r.speed + d * RPM) for r, d in off))


def table(law, noise=0.0, seed=0):
    """Return a table of jump speeds of a known follower, with noise in rpm.

    The follower has 1.1 kg, 25 N and 8 N·s/m.
    """
    read, _ = table_of(law, MACHINE, SET_UPS)
    return moved(read, noise * np.random.default_rng(seed).standard_normal(len(SET_UPS)))


def random_table(random, columns, make_cam):
    """Return random exact jump speeds of a random follower and cam.

    The cam has one rise and one fall. The results are the law, the table of jump speeds, the
    parameters, and the range (°) of the jump angles. `columns` are the varied quantities.
    """
    first, second = random.uniform(60.0, 140.0, 2).round()
    laws = ["cycloidal", "poly345", "poly4567", "modified_sine", "simple_harmonic"]
    up, down = random.choice(laws, 2)
    event = rise(first, 1.0, up), dwell(30.0), rise(second, 0.0, down)
    law = build_law(make_cam(*event, dwell(330.0 - first - second), lift=0.008))
    mass, spring, preload = 10.0 ** random.uniform([-1.0, 2.7, 0.7], [1.0, 4.3, 2.3])
    damping = 2.0 * 10.0 ** random.uniform(-2.0, -0.2) * math.sqrt(mass * spring)
    choices = {
        "mass": mass * np.array([0.0, *random.uniform([0.2, 0.8], [0.8, 2.0])]),
        "spring_stiffness": spring * np.array([1.0, *random.uniform([1.3, 2.0], [2.0, 4.0])]),
        "preload": preload * np.array([1.0, random.uniform(1.5, 2.5)]),
    }
    truth = {"mass": mass, "spring_stiffness": spring, "preload": preload, "damping": damping}
    chosen = product(*(choices[name].tolist() for name in columns))
    set_ups = [dict(zip(columns, one, strict=True)) for one in chosen]
    read, angles = table_of(law, truth | {"restitution": 0.0}, set_ups)
    return law, read, truth, math.degrees(np.ptp(angles))


def values(fit):
    return {n.name: n.value for n in fit.numbers}


def test_exact_speeds_identify_the_parameters(law, rig):
    """Nine exact jump speeds identify mass, preload and damping.

    They agree within 1e-4 and 1e-3, the tolerance of the search. The restitution is not identified.
    """
    found = values(fit_jumps(law, table(law), rig))
    assert found["mass"] == pytest.approx(OWN_MASS, rel=1e-4)
    assert found["preload"] == pytest.approx(PRELOAD, rel=1e-3)
    assert found["damping"] == pytest.approx(DAMPING, rel=1e-3)
    assert found["restitution"] is None


@pytest.mark.parametrize("seed", range(80))
@pytest.mark.parametrize("columns", COLUMNS)
@pytest.mark.variants(12)
def test_result_does_not_depend_on_the_start(make_cam, rig, columns, seed):
    """The fit of jump speeds returns the true parameters from any start.

    The sum of squares has two minima, because damping raises the jump speeds of a rise and lowers
    those of a fall.
    """
    random, apart = np.random.default_rng(seed), math.inf
    while apart > 20.0:
        law, read, truth, apart = random_table(random, columns, make_cam)
    fit = fit_jumps(law, read, rig)
    found = values(fit)
    assert found["mass"] == pytest.approx(truth["mass"], rel=1e-4)
    assert np.abs(fit.residuals).max() < 1e-5 * read.rpm.max()
    if found["damping"] is not None:
        assert found["damping"] == pytest.approx(truth["damping"], rel=1e-2)


def test_roller_share_is_identified(laws, paper_rig):
    """Exact jump speeds of two masses identify the roller's share of the mass.

    A search from the best single start value would end at another follower.
    """
    law, truth = laws["cycloidal"], numbers_of(paper_rig, "stem_stiffness", "roller_share")
    truth |= {"stem_damping": truth["damping"], "restitution": 0.0}
    read, _ = table_of(law, truth, SET_UPS)
    fixed = {name: truth[name] for name in ("damping", "stem_stiffness")}
    found = values(fit_jumps(law, read, paper_rig.with_follower(mass=1.0), "two_mass", fixed))
    assert found["mass"] == pytest.approx(truth["mass"], rel=1e-6)
    assert found["roller_share"] == pytest.approx(truth["roller_share"], rel=1e-6)


@pytest.mark.long
def test_intervals_contain_the_truth(law, rig):
    """At least 16 of 20 95 % intervals of a jump-speed fit contain the truth.

    The jump speeds have errors of 0.5 rpm.
    """
    inside = 0
    for seed in range(10):
        read = table(law, noise=0.5, seed=seed)
        fit = fit_jumps(law, read, rig, fixed={"damping": DAMPING}, error=0.5)
        for number, truth in ((fit.numbers[0], OWN_MASS), (fit.numbers[1], PRELOAD)):
            inside += abs(number.value - truth) < 1.96 * number.error
    assert inside >= 16


def test_without_masses_no_parameter_is_identifiable(law, rig):
    """If a table of jump speeds has no column of masses, no parameter is identifiable.

    The condition F = 0 at the jump is homogeneous in mass, damping, spring and preload, so only
    their ratios are determined.
    """
    read = table(law)
    same = replace(read.readings[4], setup={})
    one = replace(read, columns=(), readings=(same,) * 5)
    fit = fit_jumps(law, one, rig, error=1.0)
    assert all(n.value is None for n in fit.numbers)
    assert any("not identifiable apart" in words for words in fit.conclusions())


def test_an_unidentified_mass_has_student_s_interval(law, rig):
    """A fitted mass with too large an error has only an interval of Student's t.

    It has no value. Five speeds with errors of 1 rpm and one spring do not determine it. The factor
    of the interval falls with the degrees of freedom, which rise with each given parameter.
    """
    machine = MACHINE | {"mass": 0.8, "spring_stiffness": 4e3}
    read, _ = table_of(law, machine, [{"mass": on} for on in (0.0, 0.2, 0.4, 0.8, 1.2)])
    read = moved(read, (1.0, -1.0, 1.0, -1.0, 1.0))
    fit = fit_jumps(law, read, rig, fixed={"damping": DAMPING})
    mass, words = fit.numbers[0], " ".join(fit.conclusions())
    assert mass.value is None
    assert mass.reason.startswith("with 95 % it is below")
    assert "reach 4.3 standard errors" in words
    fit = fit_jumps(law, read, rig, fixed={"damping": DAMPING, "mass": 0.8})
    assert "reach 3.18 standard errors" in " ".join(fit.conclusions())


def test_a_column_of_total_masses_is_detected(law, rig):
    """A table whose masses are total instead of added masses is reported.

    The mass left for the follower is then not positive.
    """
    read = table(law)
    total = [
        replace(r, setup=r.setup | {"mass": OWN_MASS + r.setup["mass"]}) for r in read.readings
    ]
    fit = fit_jumps(law, replace(read, readings=tuple(total)), rig, error=0.5)
    assert fit.numbers[0].reason.endswith("in addition to the added mass: is that the total mass?")


def test_too_few_readings_are_refused(law, rig):
    """A table with fewer jump speeds than free parameters plus one is refused."""
    read = table(law)
    few = replace(read, readings=read.readings[:2])
    with pytest.raises(
        ConfigError, match=r"3 free parameters .* require at least 4 readings, got 2"
    ):
        fit_jumps(law, few, rig)


@pytest.mark.long
def test_an_outlier_is_named(law, rig):
    """The fit's conclusions give the line of a jump speed that is 30 rpm off."""
    wrong = moved(table(law, noise=0.3), 30.0 * (np.arange(9) == 4))
    fit = fit_jumps(law, wrong, rig, error=0.3)
    assert any("Line 6" in words for words in fit.conclusions())


def test_error_names_a_wrong_speed(law, rig):
    """If a jump speed is 30 % too high, the error gives its line.

    No follower fits such readings.
    """
    read = table(law)
    wrong = moved(read, 0.3 * read.rpm * (np.arange(9) == 4))
    with pytest.raises(ConfigError, match=r"no follower was found .* in line 6;"):
        fit_jumps(law, wrong, rig)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"speed": 1e308 * RPM}, r"the jump speed must be between .* rpm, got 1e\+308"),
        ({"speed": 1.1e5 * RPM}, "the jump speed must be between .* rpm, got 110000"),
        ({"speed": 0.5 * RPM}, r"the jump speed must be between .* rpm, got 0\.5"),
        (
            {"setup": {"spring_stiffness": 1e280}},
            r"spring_stiffness must be at most .* N/m, got 1e\+280",
        ),
    ],
)
def test_readings_outside_the_limits_are_errors(law, rig, change, words):
    """A jump speed outside the limits is an error with its line, value and limit."""
    read = table(law)
    wrong = (*read.readings[:-1], replace(read.readings[-1], **change))
    with pytest.raises(ConfigError, match=f"line 10: {words}"):
        fit_jumps(law, replace(read, readings=wrong), rig)


@pytest.mark.long
def test_equal_set_ups_are_solved_once(law, rig, monkeypatch):
    """A thousand readings of nine set-ups need as many jump searches as nine readings.

    A set-up is a combination of added mass, spring and preload. Each counts with the mean of its
    readings, so the fitted parameters are the same.
    """
    count = 0

    def counted(*arguments):
        nonlocal count
        count += 1
        return find_jump(*arguments)

    monkeypatch.setattr(jump_search, "find_jump", counted)
    read = table(law, noise=0.5)
    once = fit_jumps(law, read, rig, fixed={"damping": DAMPING})
    alone, count = count, 0
    both = [replace(r, speed=r.speed + d * RPM) for r in read.readings for d in (0.1, -0.1)]
    many = replace(read, readings=tuple(both * 500))
    fit = fit_jumps(law, many, rig, fixed={"damping": DAMPING})
    assert count < 1.5 * alone
    assert values(fit)["mass"] == pytest.approx(values(once)["mass"], rel=1e-5)
    assert values(fit)["preload"] == pytest.approx(values(once)["preload"], rel=1e-4)
