"""Tests of the measured costs that docs/develop/cost.md lists.

The costs are those of an event, a sweep point, a start of a program and a sample.
"""

import subprocess

import pytest

from benchmark import scaling
from benchmark.scaling import Scaling
from benchmark.speed import cases as rate
from benchmark.speed import start_up
from benchmark.speed.event_cost import EventCost, event_costs, event_table
from benchmark.speed.steady_cost import steady_costs, steady_table
from cam_rig.show.tables import to_markdown


@pytest.mark.long
@pytest.mark.slow
def test_events_are_known_to_a_picosecond():
    """Compiled and plain Python searches find lift-offs and landings to 1 ps.

    Their errors are equal. The reference was computed with 50 digits, for a two-mass follower with
    a soft stem.
    """
    costs = event_costs(("two_mass_soft",), peer="none", repeats=1)
    forms = [cost.solver.rpartition(", ")[2] for cost in costs]
    assert forms == ["compiled", "compiled", "plain Python", "compiled", "compiled"]
    assert len({cost.error_s for cost in costs}) == 1
    assert all(cost.error_s <= 1e-12 and cost.time_s > 0.0 for cost in costs)


def test_a_ratio_is_to_the_first_row_of_the_case():
    """The last column of the cost table is the time relative to the case's first row."""
    costs = [EventCost("a", 3, "one", 1e-5, 1e-15), EventCost("a", 3, "other", 4e-3, 1e-12)]
    rows = event_table(costs).rows
    assert [row[-1] for row in rows] == [1.0, 400.0]
    assert [row[0] for row in rows] == ["a: 3", ""]
    assert rows[1][2] == 4e3


# -- cost of a sweep point, as in the table of docs/develop/cost.md


def test_the_peer_has_flights_above_the_jump_speed_alone():
    """The compared solver is timed only at speeds at which the follower lifts off.

    The TM21 cam keeps contact at 300 rpm, and the run at 450 rpm has 10 landings. The ratio of
    times is empty at 300 rpm, and everywhere without the library of the compared solver.
    """
    costs = steady_costs((300.0, 450.0), repeats=1)
    assert [cost.landings for cost in costs] == [0, 10]
    assert [cost.samples for cost in costs] == [24_000, 16_000]
    assert costs[0].peer_s is None
    rows = steady_table(costs).rows
    assert rows[0][-1] is None
    ratio = costs[1].peer_s and costs[1].peer_s / costs[1].time_s  # None without the peer
    assert rows[1][-1] == ratio


# -- cost of a start, as in the tables of docs/develop/cost.md


def test_a_command_counts_with_the_processes_it_waits_for():
    """The measured cost of a command includes the time of its child processes.

    The ratio in the table is relative to a Python process that starts and ends at once.
    """
    child = "import time\nwhile time.process_time() < 0.2: pass"
    parent = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    (found,) = start_up.command_times([("busy", ("-c", parent))], repeats=1)
    assert found.cpu_s > 0.2 and found.wall_s > 0.2
    words, *_, ratio = start_up.command_table([found]).rows[0]
    assert (words, ratio) == ("busy", found.wall_s / found.bare_s)


def test_a_command_that_fails_is_no_measurement():
    """A command that fails raises an error instead of a measurement."""
    with pytest.raises(subprocess.CalledProcessError):
        start_up.command_times([("none", ("-c", "raise SystemExit(3)"))], repeats=1)


@pytest.mark.ros
def test_a_forked_node_has_little_left_to_import(monkeypatch):
    """A forked node imports at most a third of the modules of a separate start."""
    monkeypatch.setattr(start_up, "NODES", ("follower",))
    (found,) = start_up.node_starts(repeats=1)
    assert 0 < 3 * found.forked_modules < found.alone_modules
    assert start_up.node_table([found]).rows[0][0] == "follower"


# -- samples per second, compared with a copy of the same bytes


def test_each_rate_has_its_copy(monkeypatch):
    """The table of sample rates has one row for each model and speed.

    A row has the computed samples per second, the values per second of a plain memory copy, and
    their ratio.
    """
    monkeypatch.setattr(rate, "REPEATS", 2)
    found = rate.sample_rates(blocks=(2048,))
    assert [(one.model, one.rpm) for one in found] == [
        (model, rpm) for rpm in rate.SPEEDS_RPM for model in rate.SAMPLED
    ]
    for one in found:
        assert min(one.copied_per_s, one.samples_per_s, one.ratio) > 0.0
    text = to_markdown(rate.rate_table(found))
    assert text.count("\n| ") == 1 + 1 + len(found)
    assert "time over a copy's" in text


def test_a_copy_moves_what_a_block_holds(monkeypatch):
    """A block of samples and the memory copy that it is timed against have equal size.

    Rates are medians of the repetitions, and the ratio is the median of their ratios.
    """
    sizes = []

    def timed(*works):
        made, copied = (work() for work in works)
        sizes.append((made[1].rows.nbytes, copied.nbytes))
        return [(1.0, 2.0), (6.0, 4.0), (2.0, 2.0)]

    monkeypatch.setattr(rate, "_seconds", timed)
    found = rate.sample_rates(blocks=(1000,))
    assert set(sizes) == {(6 * 1000 * 8, 6 * 1000 * 8)}
    assert {one.ratio for one in found} == {1.0}
    assert {(one.samples_per_s, one.copied_per_s) for one in found} == {(500.0, 500.0)}


# -- time against the size of a problem, as in the figure of docs/develop/cost.md


def test_the_exponent_is_that_of_the_large_sizes():
    """The exponent is fitted to sizes at which constant costs do not dominate."""
    sizes = (1.0, 10.0, 1000.0, 10_000.0)
    times = (5.0, 5.0, *(1e-3 * size**0.5 for size in sizes[2:]))
    assert Scaling("rigs", sizes, times, None).exponent == pytest.approx(0.5, abs=1e-12)


def test_the_memory_of_a_run_does_not_grow_with_its_turns():
    """A run of 400 turns allocates at most 1.5 times the memory of a run of 100 turns."""
    measured = scaling.by_turns((100, 400))
    assert measured.sizes == (100, 400)
    low, high = measured.memory
    assert high < 1.5 * low
