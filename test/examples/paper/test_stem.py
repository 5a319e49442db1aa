"""Tests of a stem of n masses, and of its limit, a continuous bar.

They compare with two masses and closed forms.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.acoustics import RadiationParameters, level_db
from cam_rig.acoustics.pressure import mean_square_rate
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.free_masses import contact_response, force_output
from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.linear.response import LinearResponse, Outputs, sample
from cam_rig.units import RPM, TURN
from examples.paper import stem as script
from examples.paper.stem import BAR, Stem, stem_jump, stem_turn


def chain_response(law, stem, speed):
    """Return the linear response of a chain of masses in contact, and its outputs.

    The outputs are contact force (N) and displacement of the head (m), the end of the stem that
    carries the mass. The state is displacement and velocity of each node from the foot on, relative
    to its static position under the lift, so that the rounding of the lift is not multiplied by the
    stiffness.
    """
    f, n = stem.follower, int(stem.elements)
    masses = np.full(n, stem.mass / n)
    masses[-1] = 0.5 * stem.mass / n + stem.head_mass
    ladder = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    ladder[-1, -1] = 1.0
    stiffness, damping = n * f.stem_stiffness * ladder, n * f.stem_damping * ladder
    stiffness[-1, -1] += f.spring_stiffness
    damping[-1, -1] += f.damping
    left = f.spring_stiffness / f.stiffness  # 1 − α
    static = 1.0 - left * np.arange(1, n + 1) / n
    matrix = np.zeros((2 * n, 2 * n))
    matrix[::2, 1::2] = np.eye(n)
    matrix[1::2, ::2] = -stiffness / masses[:, None]
    matrix[1::2, 1::2] = -damping / masses[:, None]
    drive = np.zeros((2 * n, 3))
    drive[1::2, 1] = -damping @ static
    drive[1, 1] += n * f.stem_damping
    drive[1::2, 1] /= masses
    drive[1::2, 2] = -static
    state, motion = np.zeros((2, 2 * n)), np.zeros((2, 3))
    state[0, :2] = -n * f.stem_stiffness, -n * f.stem_damping
    state[1, -2] = 1.0
    on_cam = stem.foot_mass + 0.5 * stem.mass / stem.elements
    motion[0] = f.stem_stiffness * left, f.stem_damping * left, on_cam
    motion[1, 0] = f.share
    outputs = Outputs(state, motion, np.array([f.share * f.preload, -f.preload / f.stiffness]))
    return LinearResponse(law, speed, matrix, drive, np.zeros(2 * n)), outputs


def exact(law, stem, speed, count):
    """Return contact force (N) and head displacement (m) of a steady turn.

    The shape is (2, count).
    """
    model, outputs = chain_response(law, stem, speed)
    return sample(model, model.periodic(), 0.0, 0.0, TURN / speed / count, count, outputs)


SPEED = 300.0 * RPM


def some_follower(seed):
    """Return a random damped follower of two masses.

    Its stiffness is limited so that harmonics resolve its vibration.
    """
    rng = np.random.default_rng(seed)
    return TwoMassParameters(
        *rng.uniform(0.2, 1.5, 2), 10.0 ** rng.uniform(5.5, 7.0), rng.uniform(1e3, 1e4),
        *rng.uniform(2.0, 30.0, 2), rng.uniform(10.0, 50.0),
    )  # fmt: skip


def test_masses_and_static_stiffness_are_kept(two_mass):
    """Any number of stem masses keeps the total mass and the static stiffness."""
    for elements in (1.0, 2.0, 7.0, BAR):
        stem = Stem(two_mass, elements)
        total = stem.foot_mass + stem.mass + stem.head_mass
        assert total == pytest.approx(two_mass.roller_mass + two_mass.end_mass)
        force, head = stem.transfer(np.array([1e-4j]))
        assert abs(force[0]) == pytest.approx(two_mass.share * two_mass.spring_stiffness, rel=1e-6)
        assert abs(head[0]) == pytest.approx(two_mass.share, rel=1e-6)


@pytest.mark.variants(8)
@pytest.mark.parametrize("seed", range(3))
def test_one_element_is_the_two_mass_follower(law, seed):
    """A stem of one element has the contact force of two masses, within 1e-9 N."""
    p = some_follower(seed)
    model = contact_response(law, p, SPEED)
    step = TURN / SPEED / 500
    two = sample(model, model.periodic(), 0.0, 0.0, step, 500, force_output(p))[0]
    np.testing.assert_allclose(exact(law, Stem(p, 1.0), SPEED, 500)[0], two, rtol=0, atol=1e-9)


@pytest.mark.parametrize("elements", [1.0, 2.0, 5.0])
def test_natural_frequencies_are_those_of_the_matrix(laws, two_mass, elements):
    """The natural frequencies of a stem are those of the undamped chain's matrix.

    These are the imaginary parts of its eigenvalues.
    """
    undamped = Stem(replace(two_mass, stem_damping=0.0, damping=0.0), elements)
    model = chain_response(laws["poly345"], undamped, SPEED)[0]
    rates = np.sort(np.abs(np.linalg.eigvals(model.matrix).imag))[::2]
    np.testing.assert_allclose(undamped.frequencies(9), rates, rtol=1e-9)


def test_a_fixed_free_bar(two_mass):
    """Without head mass and spring the stem has the frequencies of a fixed-free bar.

    Those of the bar are (i + ½) π √(k/m), those of the chain √(4 n² k/m) sin((i + ½) π/2n).
    """
    free = replace(two_mass, roller_mass=0.65, end_mass=0.65, spring_stiffness=1e-9)
    rate, mode = math.sqrt(free.stem_stiffness / 1.3), np.arange(4) + 0.5
    bar = Stem(free, BAR).frequencies(4)
    np.testing.assert_allclose(bar, mode * math.pi * rate, rtol=1e-12)
    chain = Stem(free, 12.0).frequencies(4)
    np.testing.assert_allclose(chain, 24.0 * rate * np.sin(mode * math.pi / 24.0), rtol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_masses_tend_to_the_bar_as_one_over_n_squared(seed):
    """With twice the masses, a stem's error against a continuous bar is a quarter.

    This is true for natural frequencies and transfer functions.
    """
    p, rates = some_follower(seed), 1j * np.array([300.0, 900.0, 2500.0])
    limit, bar = Stem(p, BAR).frequencies(3), Stem(p, BAR).transfer(rates)
    errors = []
    for n in (32.0, 64.0):
        chain = Stem(p, n)
        found = chain.frequencies(3)
        away = [np.abs(a - b) for a, b in zip(chain.transfer(rates), bar, strict=True)]
        errors.append(np.concatenate([np.abs(found - limit), *away]))
    np.testing.assert_allclose(errors[0] / errors[1], 4.0, rtol=0.02)
    assert (errors[1][:3] / limit < 0.01).all()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("elements", [1.0, 3.0, 8.0])
def test_the_series_is_the_exact_solver(laws, seed, elements):
    """The steady turn of a stem, computed by harmonics, agrees with the exact solver.

    The tolerances are 1e-5 of the largest force and 1e-6 of the largest displacement.
    """
    law, stem = laws[("poly4567", "bezier15")[seed % 2]], Stem(some_follower(seed), elements)
    turn = stem_turn(law, stem, SPEED)
    force, head = exact(law, stem, SPEED, turn.angle.size)
    p = stem.follower
    head += p.preload / p.stiffness - p.share * law(turn.angle)
    np.testing.assert_allclose(turn.force, force, rtol=0, atol=1e-5 * np.abs(force).max())
    np.testing.assert_allclose(turn.head, head, rtol=0, atol=1e-6 * np.abs(head).max())


# -- speed from which two masses are not sufficient: jump speed, vibration and level of a bar


@pytest.fixture(scope="module")
def found(laws, table2):
    """Result of the stem study for the 3-4-5 cam on the identified rig."""
    return script.study_stem(table2, {"poly345": laws["poly345"]})


@pytest.fixture(scope="module")
def rows(found):
    """Table of the stem study, with one row per number of masses."""
    return found.over_elements.frame


@pytest.mark.parametrize("cam", ["poly345", "bezier15", "poly4567", "cycloidal"])
def test_one_element_jumps_as_two_masses(laws, two_mass, table2, cam):
    """A stem of one element has the jump speed of two masses in `cam-rig jump`.

    That command uses a separate search with a proof. The relative tolerance is 2e-5.
    """
    expected = find_jump(laws[cam], two_mass, None).rpm
    assert stem_jump(laws[cam], Stem(two_mass, 1.0), table2) == pytest.approx(expected, rel=2e-5)


@pytest.mark.parametrize("elements", [2.0, 5.0])
def test_the_exact_solver_loses_contact_there(laws, two_mass, table2, elements):
    """At the jump speed of a stem the smallest exact force changes its sign."""
    law, stem = laws["cycloidal"], Stem(two_mass, elements)
    jump = stem_jump(law, stem, table2) * RPM
    below, above = (exact(law, stem, jump * (1.0 + s), 8000)[0].min() for s in (-1e-4, 1e-4))
    assert below > 0.0 > above


def test_the_sound_of_a_stiff_stem_is_that_of_a_rigid_follower(laws, table2, two_mass):
    """The sound level of a very stiff stem is that of a rigid follower, to 5e-4 dB.

    The exact level of the rigid follower follows from eq. 9.
    """
    law, follower = laws["poly4567"], FollowerParameters.from_rig(table2)
    radiation = RadiationParameters.from_rig(table2)
    stiff = replace(two_mass, stem_stiffness=1e10)
    turn = stem_turn(law, Stem(stiff, BAR), SPEED)
    power = mean_square_rate(law, follower, radiation.corner_rate, SPEED)
    power = radiation.gain**2 * power + radiation.background_power(SPEED)
    assert script.level(turn, radiation) == pytest.approx(level_db(math.sqrt(power)), abs=5e-4)


def test_numbers_of_the_report(found, rows):
    """The report's numbers for the 3-4-5 cam on the identified stem are reproduced."""
    assert rows["first natural frequency [Hz]"].iloc[[0, -1]].round(1).tolist() == [202.6, 221.9]
    jumps = [414.5, 369.9, 374.2, 376.4, 377.2, 377.6]
    assert rows["jump speed [rpm]"].astype(float).round(1).tolist() == jumps
    assert rows["level [dB]"].iloc[[0, -1]].round(2).tolist() == [83.86, 83.83]
    texts = found.over_cams.for_report.text_rows[0]
    assert texts[1:] == ["414.5", "377.6", "+9.78", "235", "0.54", "412.4", "1.05e6"]


def test_where_two_masses_are_not_sufficient(found, laws, two_mass):
    """From the reported speed on, two masses are not sufficient to represent the stem.

    Their smallest force differs there from that of a continuous bar by more than a tenth of the
    preload. At 5 and 10 rpm below, the difference is smaller.
    """
    rpm = float(found.over_cams.frame["force off from [rpm]"][0])

    def missed(at):
        two, bar = (stem_turn(laws["poly345"], Stem(two_mass, n), at * RPM) for n in (1.0, BAR))
        return abs(two.force.min() - bar.force.min()) / two_mass.preload

    assert missed(rpm) > 0.1 >= max(missed(rpm - 5.0), missed(rpm - 10.0))


def test_a_bar_of_the_same_frequency_jumps_nearly_as_two_masses(found, two_mass):
    """A softer bar with the first frequency of two masses jumps nearly as they do.

    Its jump speed is ten times closer to theirs than that of the bar with the same stiffness. So
    most of the error of two masses is that of this frequency.
    """
    stiffness = script.matched_stiffness(two_mass)
    bar = Stem(replace(two_mass, stem_stiffness=stiffness), BAR).frequencies(1)
    assert bar == pytest.approx(Stem(two_mass, 1.0).frequencies(1), rel=1e-10)
    assert found.matched == pytest.approx(stiffness)
    row = found.over_cams.frame.iloc[0]
    two, bar, softer = row["two masses [rpm]"], row["bar [rpm]"], row["softer bar [rpm]"]
    assert abs(two / softer - 1.0) < 0.1 * abs(two / bar - 1.0)


def test_the_script(found, printed_by, monkeypatch):
    """The stem script prints both tables and the summary. The bar is the last row."""
    monkeypatch.setattr(script, "study", lambda: [found])
    printed = printed_by(script)
    assert "two masses off by at most +9.78 % (Polynomial 3-4-5), level by 0.54 dB" in printed
    masses = [row[0] for row in found.over_elements.rows]
    assert masses == ["2", "3", "4", "6", "10", "bar"]
    assert math.isinf(script.ELEMENTS[-1])
