"""The peers converge to the reference: it, they and their right-hand sides are then right."""

import builtins

import numpy as np
import pytest

from benchmark.speed import study as stored
from benchmark.speed.peers import PEERS
from benchmark.speed.problem import intervals
from benchmark.speed.study import sweep

BY_TITLE = {peer.title: peer for peer in PEERS}
#: Case, turns of it, largest error at rtol 1e-10.
SOLVED = [
    ("resonance", 2, 1e-6),
    ("torsional", 1, 1e-6),
    ("two_mass_soft", 1, 1e-6),
    ("one_mass_arc", 2, 1e-5),
    ("elastic_stem", 1, 1e-5),
]


@pytest.mark.variants(12)
@pytest.mark.parametrize("title", ["DOP853", "CVODE BDF", "CVODE Adams", "LSODA"])
@pytest.mark.parametrize(("name", "turns", "limit"), SOLVED)
def test_a_peer_comes_to_the_reference(cases, title, name, turns, limit):
    """With the same events, in the same order."""
    if title.startswith("CVODE"):
        pytest.importorskip("sksundae")
    case = cases[name].first_turns(turns)
    reference = stored.read(case)
    found = BY_TITLE[title].solve(case, 1e-10)
    assert found.error(reference) < limit
    assert [kind for kind, _ in found.events] == [kind for kind, _ in reference.events]


def test_stretches_are_the_law(cases):
    """Lift, velocity and acceleration of the peers' cheap functions are those of the law."""
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
    """3-4-5 jumps in its third derivative at four joints; the two dwells at 0° are one."""
    case = cases["resonance"]
    assert len(intervals(case.law, case.speed, 3)) == 3 * 4 + 1


def test_a_missing_peer_is_skipped_with_the_remedy(cases, monkeypatch):
    """Without scikit-sundae there is a note with what to install, and no point."""
    true_import = builtins.__import__

    def no_sundae(name, *rest, **more):
        if name.startswith("sksundae"):
            raise ImportError(name)
        return true_import(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", no_sundae)
    case = cases["resonance"].first_turns(1)
    found = sweep(case, BY_TITLE["CVODE BDF"], stored.read(case), (1e-4,), 1.0)
    assert found.points == []
    assert "pip install scikit-sundae" in found.notes[0]


def test_a_sweep_keeps_to_its_time(cases):
    """What would take too long is left out, and the sweep says so."""
    case = cases["resonance"].first_turns(1)
    rtols = tuple(10.0**-i for i in range(4, 13))
    found = sweep(case, BY_TITLE["Radau"], stored.read(case), rtols, 0.15)
    assert len(found.points) < len(rtols)
    assert "left out: predicted" in found.notes[0]
