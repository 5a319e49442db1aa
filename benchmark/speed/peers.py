"""Peers of cam_rig: the compared ODE solvers and their options."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmark.speed import integration
from benchmark.speed.models import Case, Solution, Twist
from benchmark.speed.problem import Arrival, Floats, Integrator, PeerError, Problem
from cam_rig.errors import CamRigError
from cam_rig.units import FloatArray

# -- integrators of scipy, with the documented options

SCIPY_OPTIONS = "solve_ivp, atol = 0.001 rtol x usual size, t_eval, terminal event"

#: Absolute tolerance, relative to the product of relative tolerance and usual size of a state.
ABSOLUTE = 1e-3


@dataclass(frozen=True)
class ScipyPeer:
    """Method of ``solve_ivp`` with a relative tolerance."""

    method: str
    rtol: float

    def __call__(
        self, problem: Problem, state: Floats, begin: float, end: float, times: FloatArray
    ) -> Arrival:
        """Integrate; see `benchmark.speed.problem.Integrator`."""
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
            event_time, q = float(done.t_events[0][-1]), done.y_events[0][-1]
            count = int(np.searchsorted(times, event_time, side="right"))
            outputs = np.reshape(done.y, (len(state), -1))[:, :count]
            return Arrival(event_time, q.tolist(), outputs, True)
        return Arrival(end, done.y[:, -1].tolist(), done.y[:, :-1], False)

    def _jacobian(self, problem: Problem) -> Any:
        if problem.constant and self.method == "Radau":
            return problem.jacobian(0.0, [])
        return lambda t, q: problem.jacobian(t, q.tolist())


# -- SUNDIALS CVODE through scikit-sundae, with Jacobian and root finding

OPTIONS = "dense Newton with Jacobian, root finding, atol = 0.001 rtol x usual size"

#: Largest number of steps to an output time, which is never reached here.
MAX_STEPS = 100_000_000

ROOT_FOUND = 2


def cvode_class() -> Any:
    """Return the class of the solver CVODE.

    Raises ------
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
    """CVODE with a linear multistep method, "BDF" or "Adams", and a tolerance."""

    method: str
    rtol: float
    _solvers: dict[int, tuple[Problem, Any]] = field(default_factory=dict)
    _begin: float = 0.0

    def __call__(
        self, problem: Problem, state: Floats, begin: float, end: float, times: FloatArray
    ) -> Arrival:
        """Integrate; see `benchmark.speed.problem.Integrator`."""
        if id(problem) not in self._solvers:
            self._solvers[id(problem)] = (problem, self._make(problem))
        self._begin = begin  # CVODE starts at time 0, which leaves more digits for small steps
        span = np.array([begin, *times.tolist(), end]) - begin
        if span.size == 2:  # with two times CVODE returns every internal step
            span = np.insert(span, 1, 0.5 * span[1])
        done = self._solvers[id(problem)][1].solve(span, np.array(state))
        if done.status < 0:
            raise PeerError(str(done.message))
        last = done.y[-1].tolist()
        if done.status == ROOT_FOUND:
            event_time = begin + float(done.t[-1])
            count = int(np.searchsorted(times, event_time, side="right"))
            return Arrival(event_time, last, done.y[1 : 1 + count].T, True)
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


@dataclass(frozen=True)
class Peer:
    """Solver with a method. Several methods can have the same ``name``.

    ``weight`` is its share of the time of the comparison. A ``slow`` peer has loose tolerances in a
    quick comparison. A ``linear_only`` peer solves only cases of linear phases.
    """

    name: str
    method: str
    options: str
    make: Callable[[str, float], Integrator]
    weight: int
    slow: bool = False
    linear_only: bool = False

    @property
    def title(self) -> str:
        """Name and method."""
        return self.name if self.name == self.method else f"{self.name} {self.method}"

    def solve(self, case: Case, rtol: float, seconds: float = math.inf) -> Solution:
        """Solve the case with a relative tolerance.

        Raises ------
        PeerError : the peer failed, or needed more than ``seconds``
        """
        is_shaft = isinstance(case.model, Twist)
        run = integration.integrate_torsion if is_shaft else integration.integrate_case
        return run(case, _limited(self.make(self.method, rtol), seconds))

    def missing(self, case: Case | None = None) -> str | None:
        """Return the reason why a peer cannot be used, for a case or at all, or None."""
        if self.linear_only and case is not None and isinstance(case.model, Twist):
            return "only cases of linear phases are compiled"
        if self.name == COMPILED and find_spec("numba") is None:
            return "numba is missing: pip install numba (extra 'fast' of cam_rig)"
        if self.name == COMPILED:
            from benchmark.speed.compiled import compile_all

            compile_all()  # before the first measured run
        if self.name != "CVODE":
            return None
        try:
            cvode_class()
        except CamRigError as error:
            return str(error)
        return None


#: Name of the peer without Python callbacks.
COMPILED = "DOP853 numba"


def compiled_peer(method: str, rtol: float) -> Integrator:
    """Return the compiled DOP853 with a relative tolerance."""
    from benchmark.speed.compiled import CompiledPeer

    return CompiledPeer(method, rtol)


def _limited(integrate: Integrator, seconds: float) -> Integrator:
    """Return an integrator with a time limit, which is checked between intervals."""
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
    Peer("CVODE", "Adams", f"scikit-sundae, {OPTIONS}", CvodePeer, 4),
    Peer("CVODE", "BDF", f"scikit-sundae, {OPTIONS}", CvodePeer, 2),
    Peer("LSODA", "LSODA", f"scipy {SCIPY_OPTIONS}, Jacobian", ScipyPeer, 2),
    Peer("Radau", "Radau", f"scipy {SCIPY_OPTIONS}, Jacobian", ScipyPeer, 1, slow=True),
    Peer(COMPILED, COMPILED, "numba, options as above", compiled_peer, 1, linear_only=True),
)
