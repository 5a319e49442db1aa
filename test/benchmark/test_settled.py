"""What a point of settled turns costs, as the table of docs/accuracy.md has it."""

from benchmark.speed.settled import settled_costs, settled_table


def test_the_peer_has_flights_above_the_jump_speed_alone():
    """TM21 stays on its cam at 300 rpm and lands once a turn at 450."""
    costs = settled_costs((300.0, 450.0), repeats=1)
    assert [cost.landings for cost in costs] == [0, 10]
    assert [cost.samples for cost in costs] == [24_000, 16_000]
    assert costs[0].peer_s is None
    rows = settled_table(costs).rows
    assert rows[0][-1] is None
    assert costs[1].peer_s is None or rows[1][-1] > 1.0
