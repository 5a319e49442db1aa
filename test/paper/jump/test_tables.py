"""Jump speeds as a table: columns of what there is, units as they are read."""

import math

import pytest

from cam_rig.dynamics.jump.any_follower import JumpRow
from cam_rig.dynamics.jump.jump_speed import Jump
from cam_rig.paper.jump.tables import jump_table, to_json

FOUND = Jump(40.0, math.pi, 0.5)
FITTED = JumpRow("a", FOUND, Jump(41.0, 0.0, 0.0), 400.0, 1.5, "fitted")


def titles(table):
    return [column.title for column in table.columns]


def test_a_row_has_its_units():
    """rpm, degrees and percent from rad/s, rad and a share."""
    table = jump_table([FITTED], "Jump", {"a": "The cam"}, {"a": 390.0})
    row = dict(zip(titles(table), table.rows[0], strict=True))
    assert row["cam"] == "The cam"
    assert row["jump speed [rpm]"] == pytest.approx(1200.0 / math.pi)
    assert row["difference [%]"] == pytest.approx(100.0 * (3.0 / math.pi - 1.0))
    assert row["cam angle [°]"] == pytest.approx(180.0)
    assert row["rigid follower [rpm]"] == 390.0


def test_what_there_is_not_has_no_column():
    """A cam of which nothing is published, in steady state."""
    table = jump_table([JumpRow("a", FOUND)], "Jump")
    assert titles(table) == ["cam", "jump speed [rpm]", "cam angle [°]", "time [s]"]
    assert not any("Fitted" in note for note in table.notes)


def test_along_a_ramp_nothing_is_compared():
    """The published speed is a constant one: no difference, and no word of a fit."""
    row = JumpRow("a", FOUND, None, 400.0, 1.5, "fitted", ramp=350.0)
    table = jump_table([row], "Jump")
    assert "use" not in titles(table)
    assert "difference [%]" not in titles(table)
    assert to_json([row])["a"]["difference"] is None
