"""Claims as a table: one row for each measure, each rig's verdict beside it."""

from cam_rig.paper.vibration.study import Claim, claims_table

OTHER = Claim("least residual vibration", "fig. 5", 0, 4, "peak to peak")
CLAIM = Claim("least residual vibration", "fig. 5", 4, 4, "residual amplitude", OTHER)
SINGLE = Claim("highest jump speed", "Table 2", 1, 1)


def test_each_measure_has_a_row():
    """A claim that may be measured in two ways stands twice, with the cases of each."""
    table = claims_table({"elastic": [CLAIM, SINGLE], "stiff": [CLAIM]}, (200.0, 300.0))
    assert [column.title for column in table.columns[3:]] == ["elastic", "stiff"]
    assert [row[2:] for row in table.texts] == [
        ["residual amplitude", "agrees, 4 of 4", "agrees, 4 of 4"],
        ["peak to peak", "disagrees, 0 of 4", "disagrees, 0 of 4"],
        ["", "agrees", "not tested"],
    ]
    assert "200, 300 rpm" in table.notes[0]


def test_no_claim_no_row():
    """Cams that the paper does not compare have none."""
    assert claims_table({"elastic": []}, (300.0,)).rows == ()
