"""Rig time beside wall time."""

import pytest

from cam_rig.errors import ConfigError
from cam_rig.live.flow_control import Pacing, factor_of
from cam_rig.units import NS


@pytest.mark.parametrize(
    ("text", "factor"),
    [("free", None), ("real_time", 1.0), ("20x", 20.0), ("0.5×", 0.5), ("1 x", 1.0)],
)
def test_paces(text, factor):
    """Free, real time, or a factor."""
    assert factor_of(text) == factor


@pytest.mark.parametrize("text", ["", "fast", "x", "-2x", "0x", "1e9x", "nanx", "5"])
def test_other_texts_are_refused(text):
    """With what is allowed."""
    with pytest.raises(ConfigError, match="allowed: free, real_time, or a factor"):
        factor_of(text)


def test_each_state_waits_for_its_time():
    """At 4x, a state 2 s later in rig time is due half a second later."""
    pacing = Pacing()
    pacing.set("4x")
    assert pacing.wait(0, 100.0) == 0.0
    pacing.sent(0, 100.0)
    assert pacing.wait(2 * NS, 100.0) == pytest.approx(0.5)
    assert pacing.wait(2 * NS, 100.4) == pytest.approx(0.1)
    assert pacing.wait(2 * NS, 101.0) == 0.0
    pacing.sent(2 * NS, 100.55)  # a little late is made up
    assert pacing.late == 0.0
    assert pacing.wait(4 * NS, 100.55) == pytest.approx(0.45)


def test_a_late_run_reports_it_and_goes_on_from_there():
    """Five stalled seconds are not made up in a rush."""
    pacing = Pacing(1.0)
    pacing.sent(0, 0.0)
    pacing.sent(NS, 6.0)
    assert pacing.late == pytest.approx(5.0)
    assert pacing.wait(2 * NS, 6.0) == pytest.approx(1.0)
    pacing.sent(2 * NS, 7.0)
    assert pacing.late == 0.0


def test_a_stop_is_not_late():
    """Rig time stands with the cam."""
    pacing = Pacing(1.0)
    pacing.sent(0, 0.0)
    pacing.stand()
    assert pacing.wait(NS, 50.0) == 0.0
    pacing.sent(NS, 50.0)
    assert pacing.late == 0.0


def test_free_never_waits():
    """As fast as the slowest answers."""
    pacing = Pacing()
    pacing.sent(0, 0.0)
    assert pacing.wait(10**15, 0.0) == 0.0
