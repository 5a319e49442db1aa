"""SUNDIALS CVODE through scikit-sundae, with Jacobian and root finding.

A solver object is made once for each problem and used again in every turn.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.bench.peers.problem import Arrival, Floats, PeerError, Problem
from cam_rig.bench.peers.scipy_peer import ABSOLUTE
from cam_rig.errors import CamRigError

OPTIONS = "dense Newton with Jacobian, root finding, atol = 0.001 rtol x usual size"
#: Steps to the next output time before CVODE gives up: never a limit here.
MAX_STEPS = 100_000_000
ROOT_FOUND = 2


def cvode_class() -> Any:
    """The solver's class.

    Raises
    ------
    CamRigError : scikit-sundae is not installed
    """
    try:
        from sksundae.cvode import CVODE  # type: ignore[import-untyped]
    except ImportError:
        raise CamRigError(
            "SUNDIALS CVODE is missing: pip install scikit-sundae (extra 'bench' of cam_rig)"
        ) from None
    return CVODE


@dataclass
class CvodePeer:
    """CVODE with one linear multistep method, "BDF" or "Adams", at one relative tolerance."""

    method: str
    rtol: float
    _solvers: dict[int, tuple[Problem, Any]] = field(default_factory=dict)
    _begin: float = 0.0

    def __call__(
        self, problem: Problem, state: Floats, begin: float, end: float, times: FloatArray
    ) -> Arrival:
        """Integrate; see `cam_rig.bench.peers.problem.Integrator`."""
        if id(problem) not in self._solvers:
            self._solvers[id(problem)] = (problem, self._make(problem))
        self._begin = begin  # CVODE's time begins at 0: it then has digits for its first steps
        span = np.array([begin, *times.tolist(), end]) - begin
        if span.size == 2:  # two times would ask for every internal step
            span = np.insert(span, 1, 0.5 * span[1])
        done = self._solvers[id(problem)][1].solve(span, np.array(state))
        if done.status < 0:
            raise PeerError(str(done.message))
        last = done.y[-1].tolist()
        if done.status == ROOT_FOUND:
            at = begin + float(done.t[-1])
            count = int(np.searchsorted(times, at, side="right"))
            return Arrival(at, last, done.y[1 : 1 + count].T, True)
        return Arrival(end, last, done.y[1 : 1 + times.size].T, False)

    def _make(self, problem: Problem) -> Any:
        rate, jacobian, guard = problem.rate, problem.jacobian, problem.guard

        def right_side(t: float, q: FloatArray, out: FloatArray) -> None:
            for i, value in enumerate(rate(self._begin + t, q.tolist())):
                out[i] = value

        def fill(t: float, q: FloatArray, rates: FloatArray, out: FloatArray) -> None:
            out[:] = jacobian(self._begin + t, q.tolist())

        options: dict[str, Any] = {}
        if guard is not None:

            def event(t: float, q: FloatArray, out: FloatArray) -> None:
                out[0] = guard(self._begin + t, q.tolist()) if t > 0.0 else 1.0

            event.terminal, event.direction = [True], [-1]  # type: ignore[attr-defined]
            options = {"eventsfn": event, "num_events": 1}
        return cvode_class()(
            right_side,
            method=self.method,
            rtol=self.rtol,
            atol=ABSOLUTE * self.rtol * problem.scale,
            jacfn=fill,
            max_num_steps=MAX_STEPS,
            **options,
        )
