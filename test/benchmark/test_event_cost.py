"""What an event costs, as the table of docs/accuracy.md has it."""

import pytest

from benchmark.speed.event_cost import EventCost, event_costs, event_table


@pytest.mark.long
@pytest.mark.slow
def test_events_are_known_to_a_picosecond():
    """On the soft stem, by both forms of the search, against 50 digits; the errors are the same."""
    costs = event_costs(("two_mass_soft",), peer="none", repeats=1)
    assert [cost.solver.rpartition(", ")[2] for cost in costs[:4]] == [
        "compiled",
        "compiled",
        "plain Python",
        "plain Python",
    ]
    assert len({cost.error_s for cost in costs}) == 1
    assert all(cost.error_s <= 1e-12 and cost.time_s > 0.0 for cost in costs)


def test_a_ratio_is_to_the_first_row_of_the_case():
    """Which is the compiled search, or plain Python's where numba is not there."""
    costs = [EventCost("a", 3, "one", 1e-5, 1e-15), EventCost("a", 3, "other", 4e-3, 1e-12)]
    rows = event_table(costs).rows
    assert [row[-1] for row in rows] == [1.0, 400.0]
    assert [row[0] for row in rows] == ["a: 3", ""]
    assert rows[1][2] == 4e3
