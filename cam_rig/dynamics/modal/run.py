"""Least output of a vibration mode on a cam law, and the speed where it is zero.

The output is a weighted sum of the vibration and the cam's motion, for example the contact force.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from cam_rig.dynamics.events.backend import dispatch
from cam_rig.dynamics.events.run_table import CamWeights
from cam_rig.dynamics.linear.response import (
    MIN_EIGENVALUE,
    LinearResponse,
    Outputs,
    no_steady_state,
)
from cam_rig.dynamics.modal.first_zero import Climb, ClimbStatus, climb, min_output_at
from cam_rig.dynamics.modal.law_series import law_series
from cam_rig.dynamics.modal.min_output import free_at
from cam_rig.dynamics.modal.motion import (
    Oscillator,
    apply_flow,
    flow_over,
    is_resolved,
    mode_on_law,
    motion_at,
)
from cam_rig.laws import Law
from cam_rig.laws.vectors import index_at
from cam_rig.units import TURN, FloatArray

#: Number of evaluations of the output (for example a contact force) per call of the search for a
#: speed. Ctrl-C takes effect between two calls. A call takes about 20 ms in compiled code and 1 s
#: in plain Python.
EVALUATIONS_PER_CALL = 5e5


@dataclass(frozen=True)
class ModalRun:
    """Vibration mode that a cam law excites, in a run from rest or in steady state.

    The cam turns at constant speed during a run. The output of the run, for example the contact
    force, is a weighted sum of the vibration and the motion of the cam (see `Oscillator`).
    """

    law: Law
    mode: Oscillator

    @classmethod
    def of(
        cls, response: LinearResponse, outputs: Outputs, duration: float | None, row: int = 0
    ) -> ModalRun:
        """Return the run for one output of a linear model with one vibration mode.

        Parameters
        ----------
        response : LinearResponse
            Response of two states (η, η̇). Its speed is not used.
        outputs : Outputs
            Outputs of the linear model, one per row.
        duration : float or None
            Duration of the run from rest at θ = 0 in s, or None for the steady state.
        row : int, optional
            Index of the output (default: 0).
        """
        drive, cam = response.drive[1].tolist(), outputs.law[row].tolist()
        mode = Oscillator(
            stiffness=-float(response.matrix[1, 0]),
            damping=-float(response.matrix[1, 1]),
            drive=CamWeights._make((*drive, 0.0)),
            per_displacement=float(outputs.state[row, 0]),
            per_velocity=float(outputs.state[row, 1]),
            cam=CamWeights._make((*cam, float(outputs.constant[row]))),
            duration=math.inf if duration is None else float(duration),
        )
        return cls(response.law, mode)

    def min_outputs(self, speeds: FloatArray) -> FloatArray:
        """Return the least output over the run at each of m cam speeds, shape (m,).

        ``speeds`` is in rad/s, shape (m,). The result has the unit of the output, for example N for
        a contact force, and is exact to rounding.
        """
        return np.array([self.min_output(speed) for speed in speeds.tolist()])

    def min_output(self, speed: float) -> float:
        """Return the least output over the run at a cam speed (rad/s).

        It has the unit of the output, for example N for a contact force, and is exact to rounding.
        """
        return float(dispatch(min_output_at, law_series(self.law), self.mode, float(speed)))

    def is_resolved(self, speed: float) -> bool:
        """Return True if rounding does not falsify the output at a cam speed (rad/s).

        The limit of the rounding error is `cam_rig.dynamics.modal.motion.MAX_ROUNDING`, a fraction
        of the output's terms.
        """
        return is_resolved(mode_on_law(law_series(self.law), self.mode), speed)

    def steady(self, speed: float, angle: float) -> FloatArray:
        """Return the free vibration (η, η̇) at a cam angle in steady state, shape (2,).

        It is the vibration less its polynomial forced response. ``speed`` is in rad/s. ``angle`` is
        the cam angle in rad, within the first turn.

        Raises
        ------
        DynamicsError
            If the mode has no steady state at this speed.
        """
        mode, law = self.mode, law_series(self.law)
        half, period = 0.5 * mode.damping, TURN / speed
        root = cmath.sqrt(half**2 - mode.stiffness)
        if min(abs(1.0 - cmath.exp((x - half) * period)) for x in (root, -root)) < MIN_EIGENVALUE:
            raise no_steady_state(speed)
        motion = motion_at(mode_on_law(law, mode), speed)
        piece = min(index_at(law.breaks, angle), len(law.span_index) - 1)
        flow = flow_over(mode, (angle - law.breaks[piece]) / speed)
        return np.array(apply_flow(flow, free_at(motion, piece, 0)))

    def climb(self, low: float, last: float, max_evaluations: float) -> Climb:
        """Find the lowest speed (rad/s) at which the least output of the run is zero.

        The search increases the speed from ``low`` to at most ``last``, both in rad/s. `Climb`
        describes the result. Its status is PAUSED if ``max_evaluations`` evaluations of the output
        are not sufficient.
        """
        step, evaluations, law = 1.0, 0.0, law_series(self.law)
        while evaluations < max_evaluations:
            count = min(EVALUATIONS_PER_CALL, max_evaluations - evaluations)
            result: Climb = dispatch(climb, law, self.mode, low, step, last, count)
            if result.status != ClimbStatus.PAUSED:
                return result
            low, step, evaluations = result.low, result.step, evaluations + count
        return Climb(ClimbStatus.PAUSED, low, step, low, 0.0, 0.0)
