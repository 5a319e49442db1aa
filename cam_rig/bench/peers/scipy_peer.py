"""scipy's integrators, as their documentation says to use them.

``solve_ivp`` with the Jacobian (Radau and LSODA; constant where it is), output times by dense
output, and a terminal event function; the event is masked at the starting instant, where a
restart after an event would find the same root again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from cam_rig.arrays import FloatArray
from cam_rig.bench.peers.problem import Arrival, Floats, PeerError, Problem

OPTIONS = "solve_ivp, atol = 0.001 rtol x usual size, t_eval, terminal event"
#: Absolute tolerance in units of the relative one and of a state's usual size.
ABSOLUTE = 1e-3


@dataclass(frozen=True)
class ScipyPeer:
    """One method of ``solve_ivp`` at one relative tolerance."""

    method: str
    rtol: float

    def __call__(
        self, problem: Problem, state: Floats, begin: float, end: float, times: FloatArray
    ) -> Arrival:
        """Integrate; see `cam_rig.bench.peers.problem.Integrator`."""
        rate, guard = problem.rate, problem.guard
        options: dict[str, Any] = {"method": self.method, "rtol": self.rtol}
        if guard is not None:

            def event(t: float, q: FloatArray) -> float:
                return 1.0 if t <= begin else guard(t, q.tolist())

            event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
            options["events"] = [event]
        if self.method != "DOP853":
            options["jac"] = self._jacobian(problem)
        done = solve_ivp(
            lambda t, q: rate(t, q.tolist()),
            (begin, end),
            np.array(state),
            t_eval=np.append(times, end),
            atol=ABSOLUTE * self.rtol * problem.scale,
            **options,
        )
        if done.status < 0:
            raise PeerError(done.message)
        if done.status == 1:
            assert done.t_events is not None
            assert done.y_events is not None
            at, q = float(done.t_events[0][-1]), done.y_events[0][-1]
            count = int(np.searchsorted(times, at, side="right"))
            shown = np.reshape(done.y, (len(state), -1))[:, :count]
            return Arrival(at, q.tolist(), shown, True)
        return Arrival(end, done.y[:, -1].tolist(), done.y[:, :-1], False)

    def _jacobian(self, problem: Problem) -> Any:
        if problem.constant and self.method == "Radau":
            return problem.jacobian(0.0, [])
        return lambda t, q: problem.jacobian(t, q.tolist())
