"""Tests of the factorial study of slopes and continuity of motion laws.

The study separates the effects of event angle (slopes) and of continuity on jump speed, vibration
and noise.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cam_rig.laws.law import joints, peak
from cam_rig.laws.segments import up_and_down
from cam_rig.studies.noise.variants import two_levels
from cam_rig.units import TURN
from examples.paper import factorial as script
from examples.paper.factorial import shares_of, study
from examples.paper.factorial_figure import figure

from ...figure_faults import faults

RISES = ("simple_harmonic", "poly345", "cycloidal", "poly4567", "bezier9", "modified_sine")


@pytest.fixture
def no_faulty_figure():
    """Disable the check of figures, because labels overlap with only a few cases."""


@pytest.fixture(scope="module")
def found():
    """Result of the factorial study with fewer event angles, spans, speeds and cams."""
    with pytest.MonkeyPatch.context() as patch:
        for key, levels in {
            "EVENTS": (105.0, 135.0),
            "GENTLE": (110.0, 130.0),
            "SPANS": (360.0, 297.5),
            "ACCELERATED": (250.0,),
            "NOISE": (200.0, 300.0),
            "CAMS": ("bezier15", "poly345", "poly4567"),
        }.items():
            patch.setattr(script, key, levels)
        yield study()


@pytest.mark.parametrize("rise", RISES)
def test_up_and_down(rise):
    """A law of the study rises and falls by the lift over the event angle.

    Between rise and fall there are dwells.
    """
    law = up_and_down(rise, math.radians(100.0), 0.05)
    at = np.radians([0.0, 39.9, 140.1, 180.0, 219.9, 320.1])
    assert law(at) == pytest.approx([0.0, 0.0, 0.05, 0.05, 0.05, 0.0], abs=1e-12)
    assert law(np.radians([90.0, 270.0])) == pytest.approx([0.025, 0.025])
    assert law.lift == pytest.approx(0.05)


def test_no_dwell_is_left_at_180():
    """With an event angle of 180° for rise and fall no dwell is left.

    Simple harmonic motion then becomes a smooth eccentric.
    """
    law = up_and_down("simple_harmonic", math.pi, 0.05)
    assert law.spans.size == 2
    assert all(joint.continuity >= 4 for joint in joints(law))


def test_squeezed(laws):
    """`squeezed` compresses the motion of a whole turn into 240°, followed by a dwell.

    Its slopes are steeper by 360/240, its accelerations by the square of this.
    """
    law = script.squeezed(laws["bezier15"], math.radians(240.0))
    angle = np.linspace(0.0, TURN, 99, endpoint=False)
    assert law(angle * 240.0 / 360.0) == pytest.approx(laws["bezier15"](angle), abs=1e-15)
    assert not law(np.radians([241.0, 300.0, 359.0])).any()
    ratio = peak(law, 2).value / peak(laws["bezier15"], 2).value
    assert ratio == pytest.approx(1.5**2, rel=1e-9)
    assert script.squeezed(laws["bezier15"], TURN) is laws["bezier15"]


def test_cells_that_leave(found):
    """A combination of law and angle is excluded if the follower lifts off in it.

    The limit is a jump speed below 400 rpm, the highest speed of the study. The remaining laws and
    angles form a complete table.
    """
    design = found.same_acceleration
    jumps = np.array([[m.jump for m in row] for row in design.cells])
    assert (design.lost("residual") == (jumps < 400.0)).all()
    assert design.lost("residual")[0].all()  # the law with acceleration jumps
    stay = design.in_contact("residual")
    assert not stay.lost("residual").any()
    assert len(stay.cells) == len(stay.rises) >= 2
    assert "simple_harmonic" not in stay.rises
    assert not design.lost("noise").any()  # a rigid follower may lift off


def test_the_script(found, printed_by, monkeypatch):
    """The script of the factorial study prints tables and draws the figure."""
    monkeypatch.setattr(script, "study", lambda _: found)
    printed = printed_by(script)
    assert "bezier15 jumps later than 2 of 2 cams" in printed
    assert "Analysis of variance, same acceleration, C2 and above" in printed


@pytest.mark.slow
def test_numbers_of_the_report():
    """Shares of slopes and continuity, and jump speeds, are those of the report.

    The report is that on the paper.
    """
    found = study()
    by_caption = {table.caption: table.for_report.text_rows for table in script.tables(found)}
    advantage = next(rows for key, rows in by_caption.items() if key.startswith("Advantage"))
    assert [row[1:] for row in advantage] == [
        ["+37.6", "72", "-30.0", "65", "15.4", "-2.2"],
        ["+46.4", "100", "-40.2", "97", "5.0", "-4.2"],
        ["+38.1", "89", "-32.4", "81", "10.6", "-2.7"],
        ["+43.0", "101", "-40.8", "94", "9.1", "-3.6"],
    ]
    laws = next(rows for key, rows in by_caption.items() if key.startswith("Jump speed by law"))
    assert [row[2:] for row in laws] == [
        ["221", "188"], ["416", "383"], ["437", "417"], ["415", "430"], ["370", "429"],
    ]  # fmt: skip
    percent = {
        key: 100.0 * np.array(found.same_acceleration.shares(key)[:4]) for key in script.EFFECTS
    }
    assert percent["residual"].round(1).tolist() == [91.6, 90.4, 7.7, 0.8]
    assert percent["jump"].round(1).tolist() == [84.2, 83.6, 15.4, 0.4]
    assert int(found.same_acceleration.lost("residual").sum()) == 16
    jumps = [round(m.jump, 1) for m in found.squeezed.values()]
    assert jumps == [569.0, 521.6, 466.3, 426.8, 378.1]
    assert faults(figure(found)) == []


def test_up_and_down_with_another_high_dwell():
    """A law with a given high dwell has the low dwell in the rest of the turn."""
    event, high = math.radians(100.0), math.radians(20.0)
    law = up_and_down("poly345", event, 0.05, high)
    middle = 0.5 * (2.0 * math.pi - 2.0 * event - high) + event
    inside = middle + np.linspace(0.0, high, 50)
    np.testing.assert_allclose(law(inside), 0.05, atol=1e-15)
    assert law(middle - 0.01) < 0.05 and law(middle + high + 0.01) < 0.05
    none = up_and_down("poly345", event, 0.05, 0.0)
    assert none(math.pi) == pytest.approx(0.05)
    assert none(math.pi, 1) == pytest.approx(0.0, abs=1e-12)


# -- analysis of variance: sums that add up, and tables with known results


TABLES = arrays(np.float64, (3, 4), elements=st.floats(-100.0, 100.0))


@given(TABLES)
def test_shares_add_up(values):
    """The shares of rows, columns and interaction add up to the variation of a table.

    If rows and columns are exchanged, their shares are exchanged, too.
    """
    found, turned = shares_of(values, range(3)), shares_of(values.T, range(4))
    assert found.total == pytest.approx(((values - values.mean()) ** 2).sum(), abs=1e-9)
    assert found.law + found.angle + found.interaction == pytest.approx(1.0) or found.total < 1e-9
    assert (found.law, found.angle) == pytest.approx((turned.angle, turned.law), abs=1e-9)
    assert found.classes == pytest.approx(found.law, abs=1e-9)


def test_known_tables():
    """For tables with known effects of rows and columns, the shares are these effects."""
    rows, columns = np.array([-2.0, 0.0, 2.0]), np.array([-1.0, 1.0])
    added = shares_of(5.0 + rows[:, None] + columns, range(3))
    assert (added.law, added.angle, added.total) == pytest.approx((16 / 22, 6 / 22, 22.0))
    assert shares_of(np.array([[1.0, -1.0], [-1.0, 1.0]]), range(2)).interaction == 1.0
    assert shares_of(np.ones((2, 2)), range(2)).law == 0.0
    one = shares_of(np.array([[1.0, 1.0], [3.0, 3.0], [2.0, 2.0]]), [1, 1, 2])
    assert (one.law, one.classes) == pytest.approx((1.0, 0.0))


@given(arrays(np.float64, (2, 2, 2), elements=st.floats(-100.0, 100.0)))
def test_shares_of_two_levels_are_of_all(values):
    """With two levels per factor, the shares of all effects add up to 1.

    Interactions are included. For a table with two factors they equal those of `shares_of`.
    """
    shares = two_levels(values)
    total = ((values - values.mean()) ** 2).sum()
    assert len(shares) == 7
    assert sum(shares.values()) == pytest.approx(1.0) or total < 1e-9
    flat = shares_of(values[0], range(2))
    if flat.total > 1e-6:
        of_two = two_levels(values[0])
        assert of_two[(0,)] == pytest.approx(flat.law, abs=1e-6)
        assert of_two[(0, 1)] == pytest.approx(flat.interaction, abs=1e-6)
