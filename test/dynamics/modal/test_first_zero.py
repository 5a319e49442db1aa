"""Tests of the search for the lowest cam speed with a loss of contact.

No loss of contact is missed, however narrow its speed range is.
"""

import math

import numpy as np
import pytest
from scipy.interpolate import BPoly
from scipy.optimize import minimize_scalar

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.events.backend import VARIABLE
from cam_rig.dynamics.free_masses import contact_response, force_output
from cam_rig.dynamics.jump.two_masses import MIN_RPM, find_two_mass_jump, force_run
from cam_rig.dynamics.modal.group_error import GROUP_ERROR, bound_groups
from cam_rig.dynamics.modal.harmonic_error import (
    bound_output,
    bound_steady,
    can_use_harmonics,
)
from cam_rig.dynamics.modal.law_series import law_series
from cam_rig.dynamics.modal.motion import mode_on_law, motion_at, norm_of
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.units import RPM, TURN

#: Durations (s) of the runs from rest. None means the steady state.
DURATIONS = (1.7, 0.4, None)
#: Random relative change of the derivatives of the lift at joints (angles where two polynomial
#: pieces meet), from those of an eccentric cam.
SCATTER = 0.1


def random_law(rng):
    """Return a law of 1 to 60 polynomial pieces, of degree 3 to 15 and C¹ to C⁷.

    In some laws one piece is shorter than the others by a factor of up to 1000.
    """
    count = int(rng.choice([1, 2, 3, 5, 8, 12, 30, 60]))
    order = int(rng.integers(1, 8))
    widths = rng.uniform(0.3, 1.0, count)
    if count > 1 and rng.random() < 0.4:
        widths[rng.integers(count)] = 10.0 ** rng.uniform(-3.0, -1.0)
    knots = np.append(0.0, np.cumsum(widths)) * (TURN / widths.sum())
    knots[-1] = TURN
    phases = knots[:, None] + 0.5 * math.pi * np.arange(order + 1)
    values = 0.02 * (np.arange(order + 1) == 0) - 0.02 * np.cos(phases)
    values *= 1.0 + SCATTER * rng.standard_normal(values.shape)
    if count == 1:
        values[:, 1] = 1e-3 * rng.standard_normal()
    values[-1] = values[0]
    ends = zip(knots[:-1], knots[1:], values[:-1], values[1:], strict=True)
    columns = [BPoly.from_derivatives([a, b], [left, right]).c[:, 0] for a, b, left, right in ends]
    return Law("random", knots, np.stack(columns, axis=1))


def random_rig(rng):
    """Return two masses with a random stem of 1e3 to 1e10 N/m.

    The damping is 0 to three times critical, the roller's share of the mass 0.02 to 0.98.
    """
    mass, share = 10.0 ** rng.uniform(-1.0, 1.0), rng.uniform(0.02, 0.98)
    stem, spring = 10.0 ** rng.uniform(3.0, 10.0), 10.0 ** rng.uniform(2.0, 5.0)
    ratio = rng.choice([0.0, 10.0 ** rng.uniform(-4.0, -1.0), 10.0 ** rng.uniform(-2.0, 0.5)])
    damping = 2.0 * ratio * math.sqrt((stem + spring) * (1.0 - share) * mass)
    part, preload = rng.uniform(0.0, 1.0), 10.0 ** rng.uniform(0.0, 3.0)
    ends, dampers = (share * mass, (1.0 - share) * mass), (part * damping, damping - part * damping)
    return TwoMassParameters(*ends, stem, spring, *dampers, preload)


def case(seed):
    """Return a random law, a random rig of two masses, and the duration (s) of a run.

    The duration None means the steady state.
    """
    rng = np.random.default_rng(seed)
    law, rig = random_law(rng), random_rig(rng)
    duration = DURATIONS[int(rng.integers(3))]
    is_undamped = rig.stem_damping + rig.damping == 0.0
    return law, rig, DURATIONS[0] if is_undamped and duration is None else duration


#: Number of cam speeds of the scan up to the jump speed, the lowest with a loss of contact.
SPEEDS = 400
#: Number of the scan's lowest minima that a minimisation refines.
DIPS = 4
#: Allowed rounding error of a force, relative to the sum of the absolute values of its terms.
ROUNDING = 1e-11


@pytest.fixture(autouse=True)
def compiled(monkeypatch):
    """Fixture that selects compiled code.

    Each case needs thousands of evaluations.
    """
    monkeypatch.setenv(VARIABLE, "compiled")


def noise(law, rig, speed):
    """Return the rounding error (N) of a contact force at a cam speed (rad/s)."""
    on_law = mode_on_law(law_series(law), force_run(law, rig, None).mode)
    sizes, series = on_law.law.max_derivatives, on_law.series.output
    return ROUNDING * max(np.abs(series) * sizes[:-1] * speed ** np.arange(law.degree + 1.0))


def require_first(seed):
    """Check that a random case loses contact above its jump speed only.

    The smallest force is evaluated at 400 speeds below the jump speed and at the minima between
    them. It must be negative at 1 + 1e-7 times the jump speed.
    """
    law, rig, duration = case(seed)
    try:
        jump = find_two_mass_jump(law, rig, duration)
    except DynamicsError as error:  # the case has no jump speed
        assert "allowed" in str(error)
        return
    run, small = force_run(law, rig, duration), noise(law, rig, jump.speed)
    speeds = np.geomspace(MIN_RPM * RPM, jump.speed * (1.0 - 1e-9), SPEEDS)
    least = run.min_outputs(speeds)
    assert (least > -small).all()
    for i in 1 + np.argsort(least[1:-1])[:DIPS]:
        bounds = (speeds[i - 1], speeds[i + 1])
        assert minimize_scalar(run.min_output, bounds=bounds, method="bounded").fun > -small
    assert run.min_output(jump.speed * (1.0 + 1e-7)) < small
    length = duration or TURN / jump.speed
    assert jump.time <= length * (1.0 + 1e-9)
    if jump.time < length * (1.0 - 1e-9):  # else it falls only at the run's end
        size = rig.preload + np.abs(least).max()
        assert abs(run.min_output(jump.speed)) < 1e-6 * size + small


@pytest.mark.parametrize(
    "seeds",
    [
        *(range(first, first + 4) for first in (0, 16, 44, 60)),
        *(pytest.param(range(a, a + 100), marks=pytest.mark.long) for a in range(0, 4000, 100)),
    ],
    ids=str,
)
def test_no_loss_of_contact_is_stepped_over(seeds):
    """The jump speed of a random case is the lowest zero of the force in a fine scan.

    The jump speed is the lowest cam speed with a loss of contact.
    """
    for seed in seeds:
        require_first(seed)


@pytest.mark.parametrize("seed", [3809, 3873, 4417])
def test_contact_that_is_lost_at_the_end_of_the_run(seed):
    """A loss of contact at the very end of a run is found, also at a joint.

    At a joint two polynomial pieces meet, and the force may jump to a negative value.
    """
    require_first(seed)


def forces(law, rig, speed, duration, angles):
    """Return the contact force (N) of the exact model at cam angles (rad) of the run."""
    response, output = contact_response(law, rig, speed), force_output(rig)
    start = response.periodic() if duration is None else np.zeros(2)
    states = response.states(start, 0.0, angles / speed)
    motion = law.motion_at(angles) * (speed ** np.arange(3.0))[:, None]
    return (output.state @ states + output.law @ motion + output.constant[:, None])[0]


@pytest.mark.variants(8)
@pytest.mark.parametrize("seed", range(30))
def test_no_chord_error_exceeds_its_bound(seed):
    """(27) and (29) to (32) of docs/proofs.md bound the force's chord error.

    A chord error is the difference of the force from the straight line between two cam speeds.
    """
    law, rig, duration = case(seed)
    rng = np.random.default_rng(seed)
    low = 10.0 ** rng.uniform(0.0, 2.0)
    high = low * (1.0 + 10.0 ** rng.uniform(-4.0, -0.5))
    run, table = force_run(law, rig, duration), law_series(law)
    if not run.is_resolved(high):
        return
    on_law = mode_on_law(table, run.mode)
    bounds = np.zeros(table.first_pieces.size - 1, GROUP_ERROR)
    norm = norm_of(run.mode)
    bound_groups(on_law, norm, low, high, bounds)
    last_angle = min(TURN if duration is None else high * duration, 40.0 * TURN)
    angles = np.sort(rng.uniform(0.0, last_angle, 3000))
    middle = 0.5 * (low + high)
    start, between, end = (forces(law, rig, x, duration, angles) for x in (low, middle, high))
    eighth = (high - low) ** 2 / 8.0
    forced = bounds["forced_curvature"] * eighth
    bound = np.minimum(bounds["curvature"] * eighth, 2.0 * bounds["vibration"] + forced)
    starts = table.breaks[table.first_pieces]
    group = np.searchsorted(starts, angles % TURN, side="right") - 1
    error = 0.5 * (start + end) - between
    small = 1e-12 * np.abs(between).max() + noise(law, rig, high)
    assert (error <= bound[group] * (1.0 + 1e-9) + small).all()
    if can_use_harmonics(run.mode, norm):
        motion, next_motion = (motion_at(on_law, x) for x in (low, high))
        steady = bound_steady(on_law, motion, high)
        limit = min(bound_output(on_law, motion, steady, next_motion.steady_start, high))
        assert np.abs(error).max() <= limit * (1.0 + 1e-9) + small


@pytest.mark.variants(4)
@pytest.mark.parametrize("seed", range(200, 208))
def test_plain_and_compiled_find_the_same_bits(seed, monkeypatch):
    """Plain Python and compiled code of the speed search give the same bits."""
    law, rig, duration = case(seed)
    run, climbs = force_run(law, rig, duration), []
    for value in ("plain", "compiled"):
        monkeypatch.setenv(VARIABLE, value)
        climbs.append(run.climb(MIN_RPM * RPM, 1e5 * RPM, 2e4))
    assert climbs[0] == climbs[1]
