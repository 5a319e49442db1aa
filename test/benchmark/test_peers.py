"""Tests of the peers, which are other ODE solvers that cam_rig is compared with.

They agree with the jump speeds of a campaign and with the stored references, and a peer whose
library is missing is left out.
"""

import builtins
import itertools
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from benchmark.speed import campaign
from benchmark.speed import study as stored
from benchmark.speed.campaign import (
    BATCH,
    STUDY,
    bisect_jump,
    campaign_rate,
    campaign_records,
    leaves,
)
from benchmark.speed.cases import rad_per_s
from benchmark.speed.peers import PEERS
from benchmark.speed.problem import intervals
from benchmark.speed.study import sweep
from cam_rig.dynamics import TwoMassParameters
from cam_rig.schema.load import Library, config_root
from cam_rig.studies.campaign.campaign import campaign_from, make_point, measure_batch


def test_the_peer_loses_contact_at_the_campaign_s_speed():
    """The solver CVODE finds a loss of contact only above the campaign's jump speed.

    The jump speed is the lowest cam speed with a loss of contact. The two tested speeds are 1e-4
    above and below it, relative.
    """
    found = campaign_from(
        {**STUDY, "plan": {"kind": "sobol", "points": 2}}, Library((config_root(),))
    )
    rows = measure_batch(found, 0, 1)
    p = TwoMassParameters.from_rig(make_point(found, rows.inputs[0]).rig)
    speed = rad_per_s(float(rows.measures[0, 0]))
    assert not leaves(p, found.law, speed * (1.0 - 1e-4))
    assert leaves(p, found.law, speed * (1.0 + 1e-4))


def test_the_peer_halves_down_to_the_speed(monkeypatch):
    """`bisect_jump` finds the lowest speed with a loss of contact, within 0.05 rpm.

    The check of contact is replaced by a threshold at 300.1 rpm.
    """
    monkeypatch.setattr(campaign, "leaves", lambda _p, _law, speed: speed > rad_per_s(300.1))
    assert bisect_jump(None, None, 300.0) == pytest.approx(300.1, abs=0.05)


def test_without_joblib_the_campaign_is_alone(monkeypatch):
    """Without joblib the timing of a campaign is not compared with another solver.

    A note gives the command that installs joblib.
    """
    monkeypatch.setitem(sys.modules, "joblib", None)
    found = campaign_rate(2, True)
    assert (found.processes, found.points, found.ratio) == (1, BATCH, None)
    assert found.points_per_s > 0.0
    (note,) = campaign_records(found).notes
    assert "joblib" in note and "pip install" in note


# -- convergence of the peers to the reference, which checks both and the equations of motion


BY_TITLE = {peer.title: peer for peer in PEERS}
#: Cases: name, number of turns, limit of the relative error of another solver at rtol 1e-10.
SOLVED = [
    ("resonance", 2, 1e-6),
    ("torsional", 1, 1e-6),
    ("two_mass_soft", 1, 1e-6),
    ("one_mass_arc", 2, 1e-5),
    ("ball_on_table", 2, 1e-5),
    ("elastic_stem", 1, 1e-5),
]


@pytest.mark.variants(12)
@pytest.mark.parametrize("title", ["DOP853", "CVODE BDF", "CVODE Adams", "LSODA", "DOP853 numba"])
@pytest.mark.parametrize(("name", "turns", "limit"), SOLVED)
def test_a_peer_comes_to_the_reference(cases, title, name, turns, limit):
    """Each other ODE solver agrees with the stored reference within the case's limit.

    Lift-offs and landings are the same and in the same order.
    """
    case = cases[name].first_turns(turns)
    if reason := BY_TITLE[title].missing(case):
        pytest.skip(reason)
    reference = stored.read_reference(case)
    found = BY_TITLE[title].solve(case, 1e-10)
    assert found.error(reference) < limit
    assert [kind for kind, _ in found.events] == [kind for kind, _ in reference.events]


def test_stretches_are_the_law(cases):
    """The lift functions of time given to other solvers equal the motion law.

    Lift, velocity and acceleration at constant cam speed differ by at most 1e-12 of their largest
    value.
    """
    case = cases["one_mass_arc"]
    for start, interval in intervals(case.law, case.speed, 2):
        local = np.linspace(0.0, interval.duration, 13)[1:-1]
        for order in range(3):
            function = interval.function(np.eye(4)[order])
            found = np.array([function(time) for time in local.tolist()])
            wanted = case.law(case.speed * (start + local), order) * case.speed**order
            scale = np.abs(case.law.derivative_ordinates(order)).max() * case.speed**order
            np.testing.assert_allclose(found, wanted, atol=1e-12 * scale)


def test_peers_restart_at_joints_only(cases):
    """Other solvers restart their integration only at the joints of the motion law.

    A joint is an angle where two polynomial pieces meet. The law 3-4-5 has four joints per turn,
    because the dwells before and after 0° are one piece.
    """
    case = cases["resonance"]
    assert len(intervals(case.law, case.speed, 3)) == 3 * 4 + 1


def test_a_missing_peer_is_skipped_with_the_remedy(cases, monkeypatch):
    """For a compared solver whose library is missing there are no results.

    A note gives the command that installs the library.
    """
    true_import = builtins.__import__

    def no_sundae(name, *rest, **more):
        if name.startswith("sksundae"):
            raise ImportError(name)
        return true_import(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", no_sundae)
    case = cases["resonance"].first_turns(1)
    found = sweep(case, BY_TITLE["CVODE BDF"], stored.read_reference(case), (1e-4,), 1.0)
    assert found.points == []
    assert "pip install scikit-sundae" in found.notes[0]


def test_a_sweep_keeps_to_its_time(cases, monkeypatch):
    """A sweep over tolerances leaves out those whose predicted time exceeds the limit.

    A note reports the tolerances that are left out.
    """
    seconds = itertools.count()
    monkeypatch.setattr(stored, "time", SimpleNamespace(perf_counter=lambda: next(seconds)))
    case = cases["resonance"].first_turns(1)
    rtols = tuple(10.0**-i for i in range(4, 13))
    found = sweep(case, BY_TITLE["Radau"], stored.read_reference(case), rtols, 15.0)
    assert found.points
    assert len(found.points) < len(rtols)
    assert "left out: predicted" in found.notes[0]
