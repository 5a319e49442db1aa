"""Results of `bounce_map`: motion, Lyapunov exponent and sound level of a speed."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.studies.bounce.branches import Family
from cam_rig.studies.bounce.motion import IRREGULAR, PERIODIC, UNDETERMINED
from cam_rig.studies.bounce.result import START_ABOVE
from cam_rig.studies.bounce.sweep import MASS, PRELOAD, RESTITUTION
from cam_rig.units import RPM


@pytest.fixture(scope="module")
def tm21(laws, rig):
    """Bounce map of the TM21's cam at eight speeds, restitution 0.7, from rest.

    It has the motion of the follower at each speed, turn after turn.
    """
    speeds = [310, 380, 390, 400, 420, 450, 500, 550]
    return cam_rig.bounce_map(
        laws["tm21"], rig, rpm=speeds, restitution=0.7, turns=60, transient_turns=300
    )


def test_exponents(tm21):
    """The Lyapunov exponent of each speed agrees with its kind of motion.

    It is −∞ if the follower comes to rest on the cam, and positive if the motion is irregular. For
    a periodic motion it is the logarithm of the largest multiplier, divided by the period in turns
    (absolute tolerance 1e-7). A multiplier is the growth of a small change per period.
    """
    for row in tm21.rows:
        if row.comes_to_rest:
            assert row.lyapunov_exponent == -math.inf
        elif row.motion == IRREGULAR:
            assert row.lyapunov_exponent > row.exponent_error > 0.0
        else:
            motion = Family(tm21.law, tm21.sweep, row.period).at(row.rpm * RPM, row.end)
            expected = math.log(np.abs(motion.multipliers).max()) / row.period
            assert row.lyapunov_exponent == pytest.approx(expected, abs=1e-7)
            assert motion.stable


def test_the_level_is_that_of_a_simulation(tm21, rig):
    """The sound level in a bounce map equals that of a `simulate` run.

    Both have the same restitution. The tolerance is 0.02 dB. At this speed the follower comes to
    rest in each turn.
    """
    row = tm21.rows[1]
    bouncing = rig.with_follower(restitution=0.7)
    motion = cam_rig.simulate(tm21.law, bouncing, rpm=row.rpm, turns=20, sample_rate=12_000)
    measured = cam_rig.sound_level(motion, transient_turns=4)
    assert row.level_db == pytest.approx(measured.level_db, abs=0.02)
    assert row.level_spread_db < 0.05


def test_an_executor_gives_the_same_rows(tm21, rig):
    """A bounce map computed by a thread pool equals one computed without an executor."""
    rpm, how = (
        np.array([390.0, 450.0, 310.0]),
        {"restitution": 0.7, "turns": 60, "transient_turns": 300},
    )
    with ThreadPoolExecutor(2) as pool:
        result = cam_rig.bounce_map(tm21.law, rig, rpm=rpm, executor=pool, **how)
    rows = result.data()["speeds"]
    assert rows == [tm21.data()["speeds"][i] for i in (0, 2, 5)]


def test_data_of_a_map(tm21):
    """The JSON data of a bounce map have the documented keys.

    An exponent of −∞ is stored as null, and the list `turns` has one entry per simulated turn.
    """
    data = tm21.data()
    assert data["schema"] == "cam_rig.bounce.1"
    assert data["speeds"][1]["lyapunov_exponent"] is None
    assert data["speeds"][1]["comes_to_rest"] is True
    assert len(data["turns"]) == sum(row.max_landing_speed.size for row in tm21.rows)
    assert data["bifurcations"] == []
    assert "undetermined" not in " ".join(tm21.summary())
    assert tm21.to_pandas("speeds").motion.tolist() == [row.motion for row in tm21.rows]


def test_the_first_lift_off_is_the_jump_speed(tm21, rig):
    """The first lift-off in a bounce map is at the jump speed of a rigid follower.

    The relative tolerance is 1e-12.
    """
    expected = cam_rig.jump_speed(tm21.law, rig).rpm
    assert tm21.jump_rpm == pytest.approx(expected, rel=1e-12)


def test_a_follower_that_never_lands_is_undetermined(tm21, rig):
    """The motion of a follower that never lands is undetermined.

    It has no preload and almost no spring. The period is None and the exponent is NaN.
    """
    loose = rig.with_follower(spring_stiffness=1e-9, preload=0.0, damping=0.0)
    how = {"restitution": 0.5, "turns": 20, "transient_turns": 20}
    (row,) = cam_rig.bounce_map(tm21.law, loose, rpm=[400], **how).rows
    assert (row.motion, row.period, row.landings_per_turn) == (UNDETERMINED, None, 0.0)
    assert math.isnan(row.lyapunov_exponent)


def test_a_map_at_the_speed_of_a_fold(tm21, rig):
    """At the speed of a fold the bounce map reports a motion, not an error.

    Two periodic motions merge at a fold, so the solver of periodic motions is singular there.
    """
    how = {"restitution": 0.7, "turns": 40, "transient_turns": 100, "start": START_ABOVE}
    result = cam_rig.bounce_map(tm21.law, rig, rpm=[418.8029066, 430], **how)
    assert result.rows[0].motion in (PERIODIC, UNDETERMINED, IRREGULAR)
    assert result.rows[1].motion == PERIODIC


SWEPT_RESTITUTION = {"parameter": RESTITUTION}


@pytest.mark.parametrize(
    ("how", "error", "words"),
    [
        ({"rpm": []}, ConfigError, "rpm: is empty; allowed"),
        ({"turns": 19}, ConfigError, "turns must be 20 or more, got 19"),
        ({"transient_turns": -1}, ConfigError, "transient_turns must be 0 or more, got -1"),
        ({"start": "left"}, ConfigError, "start must be one of rest, below, above, got 'left'"),
        ({"restitution": 1.0}, DynamicsError, r"restitution is 1\.0; allowed"),
        ({"rpm": [-3.0]}, ConfigError, "rpm: is -3 rpm; allowed: 1 to"),
        ({"rpm": "fast"}, ConfigError, "rpm: is 'fast'"),
        (
            {"parameter": "lift"},
            ConfigError,
            "parameter must be one of rpm, restitution, preload",
        ),
        ({"values": [1.0]}, ConfigError, "values requires a swept parameter other than rpm"),
        ({"parameter": MASS}, ConfigError, "values must be 1 to"),
        ({"parameter": MASS, "values": [0.0]}, DynamicsError, r"mass is 0\.0; allowed"),
        ({"parameter": PRELOAD, "values": [-1.0]}, DynamicsError, r"preload is -1\.0; allowed"),
        (
            SWEPT_RESTITUTION | {"values": [1.0], "restitution": None},
            DynamicsError,
            r"is 1\.0; allowed",
        ),
        (SWEPT_RESTITUTION | {"values": [0.5]}, ConfigError, "restitution cannot be combined"),
        (
            {"parameter": MASS, "values": [1.0], "rpm": [1, 2]},
            ConfigError,
            "rpm must be one speed if mass is swept, got 2",
        ),
        ({"model": "two_mass"}, ConfigError, "stem_damping: are missing; needed by two masses"),
        (
            {"model": "torsional"},
            ConfigError,
            "model must be one_mass or two_mass, got 'torsional'",
        ),
    ],
)
def test_refusals(tm21, rig, how, error, words):
    """An invalid argument of `bounce_map` raises an error with its name and limits."""
    given = {"rpm": 400.0, "turns": 20, "restitution": 0.7} | how
    with pytest.raises(error, match=words):
        cam_rig.bounce_map(tm21.law, rig, **given)
