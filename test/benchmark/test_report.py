"""Tests of the error measure, the comparison and the report of the benchmark."""

import json

import numpy as np
import pytest

from benchmark.speed import study as rig
from benchmark.speed import study as stored
from benchmark.speed.campaign import CampaignRate
from benchmark.speed.models import Solution
from benchmark.speed.peers import PEERS
from benchmark.speed.report import Comparison, notes
from benchmark.speed.study import CaseResult, Sweep, WorkPrecisionPoint, WorkPrecisionStudy
from benchmark.work_precision import quickest
from cam_rig.show.figure import write

from ..figure_faults import faults


def solution(events=(), shift=0.0):
    return Solution(np.array([[1.0, 2.0 + shift]]), np.array([[4.0, -8.0]]), tuple(events))


def point(time_s, error, rtol=None):
    return WorkPrecisionPoint(time_s, error, None, 3, rtol)


@pytest.fixture
def study(cases):
    """Result of a benchmark with two cases.

    In the first case cam_rig is compared with three other solvers. In the second case cam_rig has
    no result.
    """
    dop853, adams, bdf, *_ = PEERS
    sweeps = [
        Sweep(dop853, [point(0.2, 1e-6, 1e-6), point(0.5, 1e-9, 1e-9)], ["rest left out"]),
        Sweep(adams, [point(0.3, 1e-12, 1e-11)]),
        Sweep(bdf, [point(0.1, 1e-12, 1e-11), point(0.4, 1e-13, 1e-12)]),
    ]
    done = CaseResult(cases["resonance"], point(0.01, 2e-12), None, sweeps)
    absent = CaseResult(cases["torsional"], None, "not written yet", [Sweep(dop853)])
    rates = {"kinetostatic": 6e7, "elastic_stem": 5e7}
    campaign = CampaignRate(2, 100, 25.0, 2, 0.25, 0.016)
    both = {"resonance": done, "torsional": absent}
    return WorkPrecisionStudy(both, rates, True, 2, 1.0, campaign)


def test_error_is_relative_to_the_largest_value():
    """The error of a solver is the larger of two relative errors.

    They are those of displacement and velocity.
    """
    assert solution(shift=0.5).error(solution()) == pytest.approx(0.25)
    assert solution().error(solution()) == 0.0


def test_a_missed_event_counts_with_its_distance():
    """The error of a missed event is its distance (s) in time.

    An event is a lift-off or landing that a solver must find. It is the distance to the nearest
    event that was found. It is infinite for a solver without any event, which thus cannot be the
    best.
    """
    two, one = solution([("landing", 1.0), ("landing", 1.5)]), solution([("landing", 1.0)])
    assert one.event_error(two) == pytest.approx(0.5)
    assert two.event_error(one) == pytest.approx(0.5)
    assert solution().event_error(one) == float("inf")
    assert solution().event_error(solution()) is None


def test_a_peer_is_compared_at_its_best(study):
    """A solver is compared at its fastest setting that is as accurate as cam_rig.

    If no setting is as accurate, the fastest within ten times the smallest error is compared.
    """
    result = study.cases["resonance"]
    sweep, chosen = result.best("CVODE")
    assert (sweep.peer.method, chosen.time_s) == ("BDF", 0.1)
    assert result.best("DOP853")[1].error == 1e-9
    assert not result.as_good(result.best("DOP853")[1])
    result.sweeps[0].points.append(point(5.0, 2e-10, 1e-10))
    assert result.best("DOP853")[1].error == 1e-9


def test_json_has_every_point(study):
    """The JSON has every point, as plain data without NaN."""
    data = json.loads(json.dumps(Comparison(study).data(), allow_nan=False))
    assert [one["solver"] for one in data["points"]].count("rig") == 2
    assert len(data["points"]) == 2 + 5 + 1
    cvode = next(p for p in data["points"] if p["solver"] == "CVODE BDF" and p["compared"])
    assert (cvode["time"], cvode["ratio"]) == (0.1, pytest.approx(10.0))
    assert data["points"][6]["note"] == "not written yet"
    assert data["samples"][1] == {"model": "elastic_stem", "samples_per_s": 5e7}
    assert data["campaign"][1]["ratio"] == 100.0


def test_the_page_has_the_quickest_peer_of_a_case(study):
    """The benchmark page lists cam_rig and the fastest other solver of each case.

    A solver without results is listed if the case has no other solver.
    """
    shown = quickest(Comparison(study).tables()[0].records)
    assert [(one.case, one.solver) for one in shown] == [
        ("resonance", "rig"), ("resonance", "CVODE BDF"),
        ("torsional", "rig"), ("torsional", "DOP853"),
    ]  # fmt: skip


def test_a_peer_without_results_is_listed_last(study):
    """If no peer is as accurate, the page lists the fastest of the accurate ones.

    A peer without results, or with an error above ten times the smallest, is listed only if there
    is no other.
    """
    dop853, adams, bdf, *_ = PEERS
    study.cases["resonance"].sweeps = [
        Sweep(dop853),
        Sweep(adams, [point(0.3, 1e-10, 1e-11)]),
        Sweep(bdf, [point(0.1, 1e-4, 1e-11)]),
    ]
    shown = quickest(Comparison(study).tables()[0].records)
    assert (shown[1].solver, shown[1].point.time_s) == ("CVODE Adams", 0.3)


def test_a_ratio_that_is_only_a_bound_is_marked(study):
    """A time ratio is marked with ">" if the other solver is less accurate.

    No setting of the other solver is then as accurate as cam_rig, so the ratio is only a bound.
    """
    points, _ = Comparison(study).to_display()
    assert [row[-1] for row in points.text_rows] == ["", "> 50", "10", "", ""]
    assert [row[0] for row in points.text_rows] == ["resonance", "", "", "torsional", ""]
    assert notes(study) == ["resonance: DOP853: rest left out"]


def test_the_plot_is_a_picture(study, tmp_path):
    """The plot of the benchmark is a PNG without faults of layout."""
    figure = Comparison(study).plot()
    write(figure, tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert faults(figure) == []


@pytest.mark.parametrize(
    ("name", "error"), [("elastic_stem", 1e-12), ("resonance", 1e-11), ("torsional", 1e-12)]
)
def test_the_rig_is_near_the_reference(cases, name, error):
    """The error of cam_rig against the reference is below the limit of each case.

    Cases in which the follower leaves the cam are tested in test_bounces.
    """
    assert rig.solve(cases[name]).error(stored.read_reference(cases[name])) < error


def test_a_short_case_is_the_beginning_of_the_long_one(cases):
    """The solution of one turn equals the first turn of a longer run, to 1e-15.

    Thus a short benchmark can use the stored references of the long case.
    """
    case = cases["two_mass_soft"]
    short, whole = rig.solve(case.first_turns(1)), rig.solve(case)
    count = case.first_turns(1).times.size
    np.testing.assert_allclose(short.displacement, whole.displacement[:, :count], atol=1e-15)
