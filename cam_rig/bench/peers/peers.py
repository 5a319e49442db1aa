"""The peers by name: which solvers, and with which options."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from cam_rig.arrays import FloatArray
from cam_rig.bench.cases.case import Case, Solution
from cam_rig.bench.cases.models import Twist
from cam_rig.bench.peers import integration, torsional_peer
from cam_rig.bench.peers.cvode_peer import OPTIONS as CVODE_OPTIONS
from cam_rig.bench.peers.cvode_peer import CvodePeer, cvode_class
from cam_rig.bench.peers.problem import Arrival, Floats, Integrator, PeerError, Problem
from cam_rig.bench.peers.scipy_peer import OPTIONS as SCIPY_OPTIONS
from cam_rig.bench.peers.scipy_peer import ScipyPeer
from cam_rig.errors import CamRigError


@dataclass(frozen=True)
class Peer:
    """A solver with one method; several methods may belong to one ``name``.

    ``weight`` is its share of the study's time. A ``slow`` one gets loose tolerances in a quick
    study.
    """

    name: str
    method: str
    options: str
    make: Callable[[str, float], Integrator]
    weight: int
    slow: bool = False

    @property
    def title(self) -> str:
        """Name and method."""
        return self.name if self.name == self.method else f"{self.name} {self.method}"

    def solve(self, case: Case, rtol: float, seconds: float = math.inf) -> Solution:
        """The case at one relative tolerance.

        Raises
        ------
        PeerError : it gave up, or took more than ``seconds``
        """
        is_shaft = isinstance(case.model, Twist)
        run = torsional_peer.integrate_case if is_shaft else integration.integrate_case
        return run(case, _limited(self.make(self.method, rtol), seconds))

    def missing(self) -> str | None:
        """Why this peer cannot run here, and the remedy; None when it can."""
        if self.name != "CVODE":
            return None
        try:
            cvode_class()
        except CamRigError as error:
            return str(error)
        return None


def _limited(integrate: Integrator, seconds: float) -> Integrator:
    """The same, that stops between two intervals of the law when its time is over."""
    stop = time.perf_counter() + seconds

    def limited(
        problem: Problem, state: Floats, begin: float, end: float, times: FloatArray
    ) -> Arrival:
        if time.perf_counter() > stop:
            raise PeerError(f"not done after {seconds:.1f} s")
        return integrate(problem, state, begin, end, times)

    return limited


PEERS = (
    Peer("DOP853", "DOP853", f"scipy {SCIPY_OPTIONS}", ScipyPeer, 4),
    Peer("CVODE", "Adams", f"scikit-sundae, {CVODE_OPTIONS}", CvodePeer, 4),
    Peer("CVODE", "BDF", f"scikit-sundae, {CVODE_OPTIONS}", CvodePeer, 2),
    Peer("LSODA", "LSODA", f"scipy {SCIPY_OPTIONS}, Jacobian", ScipyPeer, 2),
    Peer("Radau", "Radau", f"scipy {SCIPY_OPTIONS}, Jacobian", ScipyPeer, 1, slow=True),
)
