"""Residual and torsional vibration of the steady motion against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.any_follower import find_contact_loss_speed, find_jump
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.kinetostatic import state_at
from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.dynamics.vibration import (
    low_dwell,
    residual_vibration,
    steady_turn,
    steady_twist,
    vibration,
)
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws import build_law
from cam_rig.studies.vibration.study import measure
from cam_rig.units import RPM
from examples.paper.factorial import squeezed

from ...conftest import dwell, rise
from ...dynamics.helpers import bumped
from ..conftest import FIVE


@pytest.fixture(scope="module")
def soft(cam_set):
    """Follower of the rig as one mass on an elastic stem."""
    return FollowerParameters.from_rig(cam_set.rig)


def test_the_low_dwell_may_contain_angle_zero(laws):
    """A low dwell that extends over θ = 0 is a single interval.

    Bézier 15, which has no dwell, gets an interval of 62.5° around its lowest lift instead.
    """
    found, other = low_dwell(laws["poly345"]), low_dwell(laws["bezier15"])
    assert found.dwell and not other.dwell
    for window in (found, other):
        assert np.degrees([window.start, window.span]) == pytest.approx([328.75, 62.5])
    inside = np.radians([330.0, 0.0, 31.0, 32.0, 180.0])
    assert found.contains(inside).tolist() == [True, True, True, False, False]


@pytest.mark.parametrize(
    ("parts", "start", "span"),
    [
        ([dwell(90), rise(60, 0), dwell(100), rise(110, 1)], 150.0, 100.0),
        ([rise(200, 0), rise(160, 1)], None, None),
    ],
)
def test_low_dwell_anywhere(make_cam, parts, start, span):
    """`low_dwell` returns the low dwell, or an interval around the lowest lift."""
    low = low_dwell(build_law(make_cam(*parts)))
    assert low.dwell == (start is not None)
    if low.dwell:
        assert np.degrees([low.start, low.span]) == pytest.approx([start, span])
    else:
        assert np.degrees(low.middle) == pytest.approx(200.0)


def test_acceleration_on_a_stiff_stem_is_that_of_the_law(laws, follower):
    """On a stiff stem the acceleration of a C3 law is s'' Ω² within 0.1 %."""
    turn = steady_turn(laws["poly4567"], follower, 300.0 * RPM)
    expected = laws["poly4567"](turn.angle, 2) * (300.0 * RPM) ** 2
    assert turn.acceleration == pytest.approx(expected, abs=1e-3 * np.abs(expected).max())


def test_the_acceleration_of_a_short_bump_is_found(laws, soft):
    """The peak acceleration of a bump of only 0.3° is found exactly.

    It is 6 h Ω² over the square of half the width, within rounding.
    """
    height, width = 3e-6, np.radians(0.3)
    law = bumped(laws["poly345"], np.radians(180.07), width, height)
    found = vibration(law, soft, None, 60.0 * RPM).rigid_acceleration
    assert found == pytest.approx(6.0 * height * (60.0 * RPM / (0.5 * width)) ** 2, rel=1e-9)


def test_residual_vibration_is_equal_for_single_and_several_speeds(laws, soft):
    """`residual_vibration` gives the same values for several speeds as for each alone."""
    speeds = np.array([200.0, 300.0, 380.0]) * RPM
    together = residual_vibration(laws["cycloidal"], soft, speeds)
    alone = [residual_vibration(laws["cycloidal"], soft, speeds[i : i + 1])[0] for i in range(3)]
    assert together == pytest.approx(np.array(alone), rel=1e-9)


@pytest.mark.parametrize("rpm", [150.0, 200.0, 300.0])
def test_a_step_of_velocity_excites_the_stem(laws, soft, rpm):
    """The residual amplitude of a law with steps of s' is that of the motion in the low dwell.

    With little damping it is half the difference of the largest and the smallest vibration, to the
    distance of its samples.
    """
    law, follower = laws["worked_example_constant_velocity"], replace(soft, damping=1e-3)
    turn, window = steady_turn(law, follower, rpm * RPM), low_dwell(law)
    expected = 0.5 * np.ptp(turn.vibration[window.contains(turn.angle)])
    found = residual_vibration(law, follower, np.array([rpm * RPM]))
    assert expected > 1e-5 and found == pytest.approx(expected, rel=2e-3)


def test_twist_on_a_stiff_shaft_is_torque_over_stiffness(laws, cam_set):
    """The twist of a stiff shaft is the torque F s' divided by the stiffness, to 1 %."""
    shaft = replace(shaft_of(cam_set.rig), shaft_stiffness=1e7, shaft_damping=10.0)
    speed = 300.0 * RPM
    law = laws["poly4567"]
    angle, twist = steady_twist(law, shaft, speed)
    forces = [state_at(law, shaft.follower, float(a), speed).contact_force for a in angle]
    torque = np.array(forces) * law(angle, 1)
    peak = np.abs(torque).max() / 1e7
    assert twist == pytest.approx(-torque / 1e7, abs=0.01 * peak)


def test_no_steady_state(laws, soft):
    """Resonance without damping has no steady state and raises DynamicsError.

    A harmonic of the cam is then at the natural frequency of the stem.
    """
    undamped = replace(soft, damping=0.0)
    rate = np.sqrt((soft.stem_stiffness + soft.spring_stiffness) / soft.mass)
    rpm = f"{rate / 24.0 / RPM:.6g}"
    with pytest.raises(DynamicsError, match=rf"no steady state at {rpm} rpm"):
        vibration(laws["poly345"], undamped, None, rate / 24.0)


def test_claims_of_the_paper(cam_set):
    """The claims of the paper on Bézier 15 are true at 250 and 300 rpm, except one.

    It has the least acceleration, vibration and twist. In the low dwell it has the smallest
    residual amplitude, but the largest peak-to-peak motion.
    """
    table = measure(cam_set, (250.0, 300.0, 300.0))
    claims = table.claims
    assert table.rpm == (250.0, 300.0)  # a repeated speed counts once
    assert len(claims) == 6
    assert all(c.holds == c.cases > 0 for c in claims if c.measure != "peak to peak")
    at = table.at(300.0)
    assert list(at) == list(FIVE)
    assert max(at, key=lambda cam: at[cam].peak_to_peak) == "bezier15"
    holds = {claim.measure: claim.holds for claim in claims if claim.source == "fig. 5"}
    assert holds == {"residual amplitude": 2, "peak to peak": 0}


def test_speeds_above_the_jump_speed_are_marked_and_not_tested(cam_set):
    """Speeds above the jump speed are marked, and no claim is tested there.

    Equation 5 assumes permanent contact.
    """
    table = measure(cam_set, (300.0, 400.0, 500.0))
    follower = TwoMassParameters.from_rig(cam_set.rig)
    jumps = {cam: find_jump(law, follower).rpm for cam, law in cam_set.laws.items()}
    assert {row.cam: row.contact_lost_rpm for row in table.rows} == pytest.approx(jumps, rel=1e-4)
    early = {"poly4567", "bezier_segments"}
    for rpm, wanted in zip(table.rpm, (set(), early, {*FIVE} - {"bezier15"}), strict=True):
        assert {r.cam for r in table.rows if r.rpm == rpm and r.contact_lost} == wanted
    assert {claim.cases for claim in table.claims} == {1}


def test_the_speed_of_lost_contact(rig, laws, cam_set):
    """`find_contact_loss_speed` returns the jump speed.

    It is 0 for a law with a velocity jump and for a rig without preload.
    """
    assert find_contact_loss_speed(laws["worked_example_constant_velocity"], cam_set.rig) == 0.0
    assert find_contact_loss_speed(laws["poly345"], cam_set.rig.with_follower(preload=0.0)) == 0.0
    expected = rigid_jump_speed(laws["poly345"], FollowerParameters.from_rig(rig))
    assert find_contact_loss_speed(laws["poly345"], rig) == expected


def test_a_rig_without_a_shaft(rig, cam_set):
    """For a rig without an elastic shaft, twists are None and have no claims."""
    table = measure(replace(cam_set, rig=rig), (300.0,))
    assert all(row.measured.twist is None for row in table.rows)
    assert not any("twist" in claim.claim for claim in table.claims)


@pytest.mark.parametrize("rpm", [0.0, -3.0, 1e-3, 3200.0, 8000.0, float("nan"), float("inf")])
def test_speeds_out_of_range_are_refused(cam_set, rpm):
    """A speed out of range is refused, and the error states the range.

    The range is 1 rpm to the speed at which the stem vibrates 1.2 times per turn.
    """
    with pytest.raises(ConfigError, match=r"speed is .* rpm; allowed: 1 to 31\d\d rpm"):
        measure(cam_set, (300.0, rpm))


@pytest.mark.variants(6)
@pytest.mark.parametrize("cam", FIVE)
@pytest.mark.parametrize("rpm", [200.0, 1000.0, 3000.0])
def test_steady_turn_is_the_fourier_series(laws, soft, cam, rpm):
    """The steady motion of a turn equals the sum of its harmonics within 1 nm.

    The residual amplitude is at most 1.1 times the largest vibration.
    """
    turn = steady_turn(laws[cam], soft, rpm * RPM)
    n = np.arange(turn.angle.size // 2 + 1) * rpm * RPM
    stiffness = soft.stem_stiffness + soft.spring_stiffness
    passed = soft.stem_stiffness / (stiffness - soft.mass * n**2 + 1j * soft.damping * n)
    expected = np.fft.irfft(np.fft.rfft(laws[cam](turn.angle)) * passed, turn.angle.size)
    assert turn.displacement == pytest.approx(expected, abs=1e-9)
    found = vibration(laws[cam], soft, None, rpm * RPM)
    assert found.residual_amplitude <= 1.1 * np.abs(turn.vibration).max()
    if found.window.dwell:  # here all vibration is residual
        inside = np.abs(turn.vibration[found.window.contains(turn.angle)]).max()
        assert found.residual_amplitude == pytest.approx(inside, rel=0.05)


def test_a_law_too_steep_to_split_is_refused(laws, soft):
    """A law is refused if its residual vibration would exceed its whole vibration.

    Such a residual is an artefact of splitting the motion of a very steep law.
    """
    law = squeezed(laws["cycloidal"], np.radians(60.0))
    words = r"residual vibration of .* in a vibration of .*; allowed"
    with pytest.raises(DynamicsError, match=words):
        residual_vibration(law, soft, np.array([3000.0 * RPM]))


def test_a_sweep_has_the_amplitude_of_each_speed(tmp_path):
    """A sweep has the residual amplitude of every speed, and its smallest and largest value.

    The figure of a sweep has one curve per cam, and a dotted one above its jump speed.
    """
    cams, sweep = ["poly4567", "polydyne_300"], [290.0, 300.0, 310.0, 400.0]
    result = cam_rig.vibration(cams, rpm=300.0, sweep=sweep)
    rows = result.to_pandas("sweep").set_index("cam")
    singles = cam_rig.vibration(cams, rpm=sweep).to_pandas("vibration")
    for cam in cams:
        single = singles[singles.cam == cam].residual_amplitude.to_numpy()
        assert rows.amplitudes[cam] == pytest.approx(single, rel=1e-9, abs=1e-16)
        assert rows.largest[cam] == pytest.approx(single.max(), rel=1e-9)
    assert rows.quietest_rpm["polydyne_300"] == 300.0 and rows.smallest["polydyne_300"] < 1e-12
    assert rows.largest["polydyne_300"] == pytest.approx(3.436e-6, rel=2e-3)
    axes = result.plot().axes[0]
    assert len(axes.lines) == 4
    assert [len(curve.get_xdata()) for curve in axes.lines] == [3, 1, 3, 1]
    assert "sweep" not in cam_rig.vibration(cams, rpm=300.0).data()
