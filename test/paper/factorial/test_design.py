"""The factorial study: laws as they are meant, known effects, conclusions from the numbers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cam_rig.errors import ConfigError
from cam_rig.laws.law import joints, peak
from cam_rig.laws.segments import up_and_down
from cam_rig.paper.factorial.conclusions import (
    BY_KEY,
    Cause,
    Classes,
    advantages,
    conclusions,
    contact_lost,
    fastest,
    governed_by,
    staying,
)
from cam_rig.paper.factorial.design import Bench, as_gentle, open_factorial, squeezed, two_way
from cam_rig.paper.factorial.study import run_factorial
from cam_rig.paper.noise.variants import two_levels
from cam_rig.units import TURN

RISES = ("simple_harmonic", "poly345", "cycloidal", "poly4567", "bezier9", "modified_sine")


@pytest.fixture(scope="module")
def config(config_dir):
    """The shipped study with fewer levels."""
    shipped = open_factorial(config_dir / "factorials" / "continuity.yaml")

    def fewer(key, *numbers):
        quantity = getattr(shipped, key)
        return quantity.model_copy(update={quantity.origin: list(numbers)})

    levels = {
        "events": fewer("events", 105, 135),
        "gentle": fewer("gentle", 110, 130),
        "squeezed": fewer("squeezed", 360, 297.5),
        "accelerated": fewer("accelerated", 250),
        "noise": fewer("noise", 200, 300),
    }
    return shipped.model_copy(update=levels)


@pytest.fixture(scope="module")
def bench(config, table2, rig):
    """Its rigs."""
    return Bench.of(config, table2, rig)


@pytest.fixture(scope="module")
def found(config, bench, laws):
    """The study, run."""
    cams = {cam: laws[cam] for cam in ("bezier15", "poly345", "poly4567")}
    return run_factorial(config, bench, cams)


@pytest.mark.parametrize("rise", RISES)
def test_up_and_down(rise):
    """It rises and falls by the lift over the angle, dwells in between, its class at the joints."""
    law = up_and_down(rise, math.radians(100.0), 0.05)
    at = np.radians([0.0, 39.9, 140.1, 180.0, 219.9, 320.1])
    assert law(at) == pytest.approx([0.0, 0.0, 0.05, 0.05, 0.05, 0.0], abs=1e-12)
    assert law(np.radians([90.0, 270.0])) == pytest.approx([0.025, 0.025])
    assert law.lift == pytest.approx(0.05)


def test_no_dwell_is_left_at_180():
    """Rise and fall of half a turn each: simple harmonic becomes an eccentric, smooth for ever."""
    law = up_and_down("simple_harmonic", math.pi, 0.05)
    assert law.spans.size == 2
    assert all(joint.continuity >= 4 for joint in joints(law))


@pytest.mark.parametrize("rise", RISES)
def test_as_gentle(rise):
    """Over its angle each law has the peak acceleration of the reference."""
    event = math.radians(120.0)
    reference = up_and_down("poly345", event, 0.05)
    law = up_and_down(rise, as_gentle(rise, "poly345", event), 0.05)
    assert abs(peak(law, 2).value) == pytest.approx(abs(peak(reference, 2).value), rel=1e-9)


def test_squeezed(laws):
    """All of the cam's turn in 240°, rest for the remaining 120°, slopes in proportion."""
    law = squeezed(laws["bezier15"], math.radians(240.0))
    angle = np.linspace(0.0, TURN, 99, endpoint=False)
    assert law(angle * 240.0 / 360.0) == pytest.approx(laws["bezier15"](angle), abs=1e-15)
    assert not law(np.radians([241.0, 300.0, 359.0])).any()
    ratio = peak(law, 2).value / peak(laws["bezier15"], 2).value
    assert ratio == pytest.approx(1.5**2, rel=1e-9)
    assert squeezed(laws["bezier15"], TURN) is laws["bezier15"]


def test_sharper_is_worse(found):
    """For every law shorter events mean an earlier jump, and more acceleration and noise."""
    for key, sign in (("jump", -1), ("acceleration", 1), ("noise", 1)):
        values = BY_KEY[key].values(found.same_angles.cells)
        assert (sign * (values[:, 0] - values[:, 1]) > 0.0).all()


def test_ringing_falls_with_continuity(found):
    """At equal acceleration each higher class rings less at every angle; noise is of the slopes."""
    design = found.same_acceleration
    values = BY_KEY["residual"].values(design.cells)
    order = np.argsort(design.classes, kind="stable")
    assert (np.diff(values[order], axis=0) < 0.0).all()
    assert governed_by(design, BY_KEY["residual"]) is Cause.CONTINUITY
    assert governed_by(design, BY_KEY["noise"]) is Cause.SLOPES


def test_advantage_adds_up(found):
    """Slopes and ringing make up all of the advantage, by the definition of the rigid follower."""
    for row in advantages(found):
        best, other = found.cams["bezier15"], found.cams[row.cam]
        gained, others = (math.log(cam.jump / cam.rigid_jump) for cam in (best, other))
        assert row.jump == pytest.approx(row.jump_slopes + gained - others)
        assert 0.5 < row.jump_share < 1.1


def test_cells_stand_in_their_places(found, bench):
    """A cell of a design is the measure of its law and angle."""
    law = up_and_down("cycloidal", math.radians(135.0), 0.05)
    assert found.same_angles.cells[2][1] == bench.measure(law)
    assert list(found.squeezed) == pytest.approx(np.radians([360.0, 297.5]))
    assert found.squeezed[found.config.squeezed.si_list[0]] == found.cams["bezier15"]


def test_conclusions_are_the_studys_numbers(found):
    """The advantage is due to the slopes, and its range is that of the shares."""
    concluded = conclusions(found)
    assert concluded.advantage is Cause.SLOPES
    assert (concluded.ahead, concluded.others) == (2, 2)
    shares = [row.jump_share for row in advantages(found)]
    assert concluded.jump_share == (min(shares), max(shares))
    assert concluded.classes is Classes.SEVERAL
    residual = concluded.same_acceleration["residual"]
    assert residual.governed_by is Cause.CONTINUITY
    assert residual.shares.law > residual.shares.classes > 0.5
    assert concluded.compressed_rpm["360"] > concluded.compressed_rpm["297.5"]


def test_the_verdict_can_turn(found):
    """Were the rigid follower to jump alike on all cams, it would be continuity."""
    cams = {cam: replace(m, rigid_jump=60.0) for cam, m in found.cams.items()}
    assert conclusions(replace(found, cams=cams)).advantage is Cause.CONTINUITY


def test_no_advantage_to_explain(found):
    """A proposed cam that is behind all others has no advantage, and no share of one."""
    slow = replace(found.cams["bezier15"], jump=1.0)
    concluded = conclusions(replace(found, cams=found.cams | {"bezier15": slow}))
    assert (concluded.advantage, concluded.jump_share) == (Cause.NONE, None)


def test_cells_that_leave(found):
    """A cell leaves whose jump speed is below its effect's fastest; the rest is a full table."""
    design, effect, config = found.same_acceleration, BY_KEY["residual"], found.config
    speed = fastest(effect, config)
    assert speed == pytest.approx(400.0 * math.pi / 30.0)
    jumps = np.array([[m.jump for m in row] for row in design.cells])
    assert (contact_lost(design, effect, config) == (jumps < speed)).all()
    assert contact_lost(design, effect, config)[0].all()  # the one law with a jump of acceleration
    stay = staying(design, effect, config)
    assert not contact_lost(stay, effect, config).any()
    assert len(stay.cells) == len(stay.rises) >= 2
    assert "simple_harmonic" not in stay.rises
    noise = contact_lost(design, BY_KEY["noise"], config)  # a rigid follower may fly and land
    assert not noise.any()
    fast = config.residual.model_copy(update={"assumed": [9e9]})
    assert staying(design, effect, config.model_copy(update={"residual": fast})) is None


def test_conclusions_count_the_cells_without_contact(found):
    """What is measured where contact is lost is not concluded from as if it were kept."""
    lost = int(contact_lost(found.same_acceleration, BY_KEY["residual"], found.config).sum())
    residual = conclusions(found).same_acceleration["residual"]
    assert sum(residual.lost.values()) == lost < residual.cells
    assert residual.lost["simple_harmonic"] == 2
    assert residual.fastest_rpm == pytest.approx(400.0)
    assert residual.in_contact is not None
    noise = conclusions(found).same_acceleration["noise"]
    assert (noise.lost, noise.fastest_rpm, noise.in_contact) == ({}, None, None)


def only(found, rises):
    """A study as it would be with some of its laws."""

    def part(design):
        rows = [i for i, rise in enumerate(design.rises) if rise in rises]
        cells = [design.cells[i] for i in rows]
        return replace(design, rises=tuple(design.rises[i] for i in rows), cells=cells)

    return replace(
        found, same_angles=part(found.same_angles), same_acceleration=part(found.same_acceleration)
    )


def test_one_class_says_nothing_of_continuity(found):
    """Laws of one class: no factor from class to class, no second step, no price of continuity."""
    some = only(found, ("poly345", "cycloidal"))
    concluded = conclusions(some)
    assert concluded.classes is Classes.ONE
    assert concluded.residual_ratio is None
    assert concluded.jump_smooth is None
    assert not (concluded.residual_falls or concluded.step_to_c2)
    assert not concluded.smooth.falls_with_class
    for effect in concluded.same_acceleration.values():
        assert effect.governed_by is not Cause.CONTINUITY
        assert effect.shares.classes is None
    assert [design.name for design in some.designs] == ["same angles", "same acceleration"]


def test_one_law_below_c2_has_no_smooth_design(found):
    """With a single law of C2 and above there is no table of such laws, and no word of them."""
    some = only(found, ("simple_harmonic", "poly345"))
    concluded = conclusions(some)
    assert concluded.classes is Classes.ONE_LAW_EACH
    assert (concluded.smooth, concluded.jump_smooth, concluded.step_to_c2) == (None, None, False)
    assert len(some.designs) == 2


def test_conclusions_turn_with_the_numbers(found):
    """Cells of the smoothest law for those of the roughest, and back: every judgement turns."""

    def turned(design):
        return replace(design, cells=design.cells[::-1])

    other = replace(
        found,
        same_angles=turned(found.same_angles),
        same_acceleration=turned(found.same_acceleration),
    )
    before, after = conclusions(found), conclusions(other)
    for verdict in ("residual_falls", "loudest_is_sharpest", "step_to_c2"):
        assert getattr(before, verdict)
        assert not getattr(after, verdict)
    assert before.residual_ratio > 1.0 > after.residual_ratio


def test_one_follower(config, table2):
    """Two rigs with different masses are no one follower."""
    with pytest.raises(ConfigError, match=r"1\.3 kg on paper_table2 and 2 kg on .*; allowed"):
        Bench.of(config, table2, table2.with_follower(mass=2.0))


def test_up_and_down_with_another_high_dwell():
    """The dwell has its width, at the lift; the low one takes the rest of the turn."""
    event, high = math.radians(100.0), math.radians(20.0)
    law = up_and_down("poly345", event, 0.05, high)
    middle = 0.5 * (2.0 * math.pi - 2.0 * event - high) + event
    inside = middle + np.linspace(0.0, high, 50)
    np.testing.assert_allclose(law(inside), 0.05, atol=1e-15)
    assert law(middle - 0.01) < 0.05 and law(middle + high + 0.01) < 0.05
    none = up_and_down("poly345", event, 0.05, 0.0)
    assert none(math.pi) == pytest.approx(0.05)
    assert none(math.pi, 1) == pytest.approx(0.0, abs=1e-12)


# -- analysis of variance: sums that add up, and tables whose answer is known -----------------


TABLES = arrays(np.float64, (3, 4), elements=st.floats(-100.0, 100.0))


@given(TABLES)
def test_sums_of_squares_add_up(values):
    """Rows, columns and interaction are all of the variation about the mean."""
    found = two_way(values)
    total = ((values - values.mean()) ** 2).sum()
    assert found.total == pytest.approx(total, abs=1e-9)
    assert sum(found.shares) == pytest.approx(1.0) or total < 1e-9
    assert found.classes == pytest.approx(found.rows, abs=1e-9)


@given(TABLES)
def test_effects_are_about_the_mean(values):
    """Effects of rows add up to nothing, and of columns."""
    found = two_way(values)
    assert found.row_effects.sum() == pytest.approx(0.0, abs=1e-9)
    assert found.column_effects.sum() == pytest.approx(0.0, abs=1e-9)
    turned = two_way(values.T)
    assert (turned.rows, turned.columns) == pytest.approx((found.columns, found.rows), abs=1e-9)


def test_additive_table_has_no_interaction():
    """Effects that add: shares as their sums of squares, nothing left."""
    rows, columns = np.array([-2.0, 0.0, 2.0]), np.array([-1.0, 1.0])
    found = two_way(5.0 + rows[:, None] + columns)
    assert found.mean == 5.0
    assert (found.rows, found.columns, found.interaction) == pytest.approx((16.0, 6.0, 0.0))


def test_pure_interaction():
    """A table of opposite corners has neither row nor column effect."""
    assert two_way(np.array([[1.0, -1.0], [-1.0, 1.0]])).shares == (0.0, 0.0, 1.0)


def test_classes_of_rows():
    """Two rows of one class that differ only between themselves leave nothing between classes."""
    values = np.array([[1.0, 1.0], [3.0, 3.0], [2.0, 2.0]])
    found = two_way(values, ["a", "a", "b"])
    assert found.rows == pytest.approx(4.0)
    assert found.classes == pytest.approx(0.0)


def test_nothing_varies():
    """A constant table has no shares to speak of."""
    assert two_way(np.ones((2, 2))).shares == (0.0, 0.0, 0.0)


@given(arrays(np.float64, (2, 2, 2), elements=st.floats(-100.0, 100.0)))
def test_shares_of_two_levels_are_of_all(values):
    """Every factor and interaction once; a two-way table gives the same two shares."""
    shares = two_levels(values)
    total = ((values - values.mean()) ** 2).sum()
    assert len(shares) == 7
    assert sum(shares.values()) == pytest.approx(1.0) or total < 1e-9
    flat = two_way(values[0])
    if flat.total > 1e-6:
        of_two = two_levels(values[0])
        assert of_two[(0,)] == pytest.approx(flat.shares[0], abs=1e-6)
        assert of_two[(0, 1)] == pytest.approx(flat.shares[2], abs=1e-6)
