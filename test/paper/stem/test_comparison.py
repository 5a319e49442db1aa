"""From which speed on two masses are not enough: jump speed, vibration and level of a bar."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.acoustics.pressure import mean_square_rate
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.jump_speed import jump_speed
from cam_rig.laws.cam import CamSet
from cam_rig.paper.stem.chain import BAR, Stem, stem_turn
from cam_rig.paper.stem.study import ELEMENTS, matched_stiffness, stem_jump, study_stems, vibration
from cam_rig.units import RPM

from ...figure_faults import faults
from .solver import exact


@pytest.fixture(scope="module")
def stems(laws, table2):
    return study_stems(CamSet({}, {"poly345": laws["poly345"]}, table2), [1.26e6], 300.0)


@pytest.fixture(scope="module")
def study(stems):
    """The polynomial 3-4-5 on the identified stem."""
    return stems.studies[0]


@pytest.mark.parametrize("cam", ["poly345", "bezier15", "poly4567", "cycloidal"])
def test_one_element_jumps_as_two_masses(laws, table2, cam):
    """The jump study's steady state, found by its own search and exact proof."""
    follower = TwoMassParameters.from_rig(table2)
    expected = jump_speed(laws[cam], follower, None).speed
    assert stem_jump(laws[cam], Stem(follower, 1.0), table2) == pytest.approx(expected, rel=2e-5)


@pytest.mark.parametrize("elements", [2.0, 5.0])
def test_the_exact_solver_loses_contact_there(laws, table2, elements):
    """A chain's least force through the rig's solver changes its sign at the jump speed."""
    law, stem = laws["cycloidal"], Stem(TwoMassParameters.from_rig(table2), elements)
    jump = stem_jump(law, stem, table2)
    least = []
    for speed in (jump * (1.0 - 1e-4), jump * (1.0 + 1e-4)):
        least.append(exact(law, stem, speed, 8000)[0].min())
    assert least[0] > 0.0 > least[1]


def test_the_sound_of_a_stiff_stem_is_that_of_a_rigid_follower(laws, table2):
    """⟨(ω_c (F − q))²⟩ by harmonics, and by the exact steady structure under eq. 9's force."""
    law, follower = laws["poly4567"], FollowerParameters.from_rig(table2)
    stiff = replace(TwoMassParameters.from_rig(table2), stem_stiffness=1e10)
    turn = stem_turn(law, Stem(stiff, BAR), 300.0 * RPM)
    expected = mean_square_rate(law, follower, 116.0, 300.0 * RPM)
    assert turn.power(116.0) == pytest.approx(expected, rel=1e-4)


def test_the_rows_tend_to_the_bar(study):
    """Frequency, jump speed, vibration and level, nearer with every mass from three on."""
    bar = study.bar
    for value in (
        lambda row: row.frequency,
        lambda row: row.jump["poly345"],
        lambda row: row.vibration["poly345"],
        lambda row: row.level["poly345"],
    ):
        away = [abs(value(row) - value(bar)) for row in study.rows[1:-1]]
        assert np.all(np.diff(away) < 0.0)
    five, nine = study.rows[-3:-1]
    ratio = (five.jump["poly345"] - bar.jump["poly345"]) / (
        nine.jump["poly345"] - bar.jump["poly345"]
    )
    assert ratio == pytest.approx((9.0 / 5.0) ** 2, rel=0.1)


def test_where_two_masses_are_not_enough(study, laws, table2):
    """At the speed given they miss the bar's least force by a tenth of the preload, not below."""
    cam, rpm = study.off
    follower = TwoMassParameters.from_rig(table2)

    def missed(at):
        two, bar = (stem_turn(laws[cam], Stem(follower, n), at * RPM) for n in (1.0, BAR))
        return abs(two.force.min() - bar.force.min()) / follower.preload

    assert missed(rpm) > 0.1 >= max(missed(rpm - 5.0), missed(rpm - 10.0))
    assert study.jump_error[0] == "poly345"
    assert abs(study.jump_error[1]) > 0.05


def test_a_bar_of_the_same_frequency_jumps_nearly_as_two_masses(study, table2):
    """What the two masses miss is mostly that frequency."""
    follower = replace(TwoMassParameters.from_rig(table2))
    stiffness = matched_stiffness(follower)
    bar = Stem(replace(follower, stem_stiffness=stiffness), BAR).natural_frequencies(1)
    assert bar == pytest.approx(Stem(follower, 1.0).natural_frequencies(1), rel=1e-10)
    assert study.matched_stiffness == pytest.approx(stiffness)
    assert abs(study.matched_error[1]) < 0.1 * abs(study.jump_error[1])


def test_vibration_is_read_in_the_low_dwell(laws, table2):
    """There the head moves about its place by the free vibration alone, dying out."""
    law = laws["poly345"]
    turn = stem_turn(law, Stem(TwoMassParameters.from_rig(table2), BAR), 300.0 * RPM)
    assert 0.0 < vibration(law, turn) < np.ptp(turn.head)


def test_tables(stems):
    """One row for each number of masses, the bar last; jump speeds of each cam."""
    over, jumps = stems.to_show({"poly345": "3-4-5"})
    assert [row[1] for row in over.texts] == ["2", "3", "4", "6", "10", "bar"]
    assert len(over.rows) == len(ELEMENTS) and math.isinf(ELEMENTS[-1])
    assert jumps.rows[0][0] == "3-4-5"
    assert faults(stems.plot()) == []
