"""The peers by name: which solvers, and with which options."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from cam_rig.bench import march, twist_peer
from cam_rig.bench.case import Case, Solution
from cam_rig.bench.cvode_peer import OPTIONS as CVODE_OPTIONS
from cam_rig.bench.cvode_peer import CvodePeer, cvode_class
from cam_rig.bench.problem import Integrator
from cam_rig.bench.scipy_peer import OPTIONS as SCIPY_OPTIONS
from cam_rig.bench.scipy_peer import ScipyPeer
from cam_rig.bench.twist import Twist
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

    def solve(self, case: Case, rtol: float) -> Solution:
        """The case at one relative tolerance."""
        run = twist_peer.march if isinstance(case.model, Twist) else march.march
        return run(case, self.make(self.method, rtol))

    def missing(self) -> str | None:
        """Why this peer cannot run here, and the remedy; None when it can."""
        if self.name != "CVODE":
            return None
        try:
            cvode_class()
        except CamRigError as error:
            return str(error)
        return None


PEERS = (
    Peer("DOP853", "DOP853", f"scipy {SCIPY_OPTIONS}", ScipyPeer, 4),
    Peer("CVODE", "Adams", f"scikit-sundae, {CVODE_OPTIONS}", CvodePeer, 3),
    Peer("CVODE", "BDF", f"scikit-sundae, {CVODE_OPTIONS}", CvodePeer, 3),
    Peer("LSODA", "LSODA", f"scipy {SCIPY_OPTIONS}, Jacobian", ScipyPeer, 2),
    Peer("Radau", "Radau", f"scipy {SCIPY_OPTIONS}, Jacobian", ScipyPeer, 1, slow=True),
)
