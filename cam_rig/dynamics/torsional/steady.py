"""Steady states of a cam on its shaft: what one turn brings back (eq. 10 of the paper).

Newton's method on the map of one turn, which is nearly linear: its slopes are taken once, by
differences, and then corrected by Broyden's rule.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.input_limits import require_number
from cam_rig.dynamics.torsional.parameters import TorsionalParameters, TorsionalState
from cam_rig.dynamics.torsional.stepper import March
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.units import TURN, to_rpm

#: A steady state returns to itself to this fraction of its peak; it is sought to PERIODIC.
RETURNS, PERIODIC = 1e-11, 1e-13
MAX_TURNS = 25
#: Change of the start taken for the slopes of the map, in peaks.
NUDGE = 0.03
#: A start that comes back to this fraction of its change: the shaft is in resonance with the cam.
RESONANT = 1e-8


def periodic_state(
    law: Law, parameters: TorsionalParameters, speed: float, flywheel_angle: float = 0.0
) -> TorsionalState:
    """The state at ``flywheel_angle`` (rad) that returns after one turn at ``speed`` (rad/s).

    Raises
    ------
    DynamicsError : as `steady_state`
    """
    return steady_state(law, parameters, speed, flywheel_angle)[1]


@lru_cache(maxsize=64)
def steady_state(
    law: Law, parameters: TorsionalParameters, speed: float, flywheel_angle: float = 0.0
) -> tuple[TorsionalParameters, TorsionalState]:
    """The state that returns after one turn at the mean ``speed`` (rad/s), and what drives it.

    A flywheel that holds its speed begins at ``flywheel_angle`` (rad). One with an inertia is
    driven by a constant torque, the mean of the load: it comes with the parameters. As any state
    of the turn may be its first, the one is taken whose flywheel passes ``flywheel_angle``
    together with even turning, without a lead.

    Raises
    ------
    DynamicsError : the flywheel stands still, or no such state is found (resonance)

    Examples
    --------
    >>> import cam_rig
    >>> from cam_rig.dynamics import MODELS
    >>> law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    >>> shaft = MODELS["torsional"].parameters(cam_rig.load_rig("paper_flywheel"))
    >>> driven, start = steady_state(law, shaft, 30.0)
    >>> start.lead, driven.motor_torque > 0.0
    (0.0, True)
    """
    require_number("flywheel_angle", flywheel_angle, "of either sign")
    require_number("speed", speed, "of either sign")
    if speed == 0.0:
        raise DynamicsError(f"speed is {speed!r}; allowed for a periodic state: finite, not 0")
    march, duration = March(law, parameters), TURN / abs(speed)
    inertia = parameters.flywheel_inertia
    # A twist in rad, and what else a free vibration of one radian has: rate, momentum, torque.
    momentum = parameters.shaft_stiffness / march.rate
    unit = np.array([1.0, march.rate, momentum / (inertia or 1.0), momentum / duration])

    def begun(x: FloatArray) -> tuple[TorsionalParameters, TorsionalState]:
        twist, rate, *free = (x * unit[: x.size]).tolist()
        start = TorsionalState(twist, rate, flywheel_angle, speed, 0.0, *free[:1])
        return replace(parameters, motor_torque=free[1]) if free else parameters, start

    def miss(x: FloatArray) -> FloatArray:
        march.parameters, start = begun(x)
        end, _ = march.run(start, duration)
        gap = [end.twist, end.twist_rate, end.lead_rate, end.lead / duration]
        gap = np.array(gap) / unit[[0, 1, 2, 2]]
        return np.asarray(gap - np.array([*x[:3], 0.0]) if x.size == 4 else gap[:2] - x)

    x, gap, slope = _fixed_point(miss, 2 if inertia is None else 4, lambda: march.peak)
    scale = max(march.peak, float(np.abs(x).max()))
    if not np.abs(gap).max() <= RETURNS * scale:
        raise DynamicsError(
            f"no periodic state at {to_rpm(speed):.6g} rpm: a turn misses its start by "
            f"{np.abs(gap).max():.3g} rad of {scale:.3g}, allowed {RETURNS:g} of it; "
            f"its slope is {slope:.3g}. Resonance needs damping"
        )
    return begun(x)


def _fixed_point(
    miss: Callable[[FloatArray], FloatArray], size: int, peak: Callable[[], float]
) -> tuple[FloatArray, FloatArray, float]:
    """Where ``miss`` is zero, what is left of it there, and the least slope on the way."""
    x = np.zeros(size)
    gap = miss(x)
    nudge = NUDGE * (peak() or 1.0)
    slopes = np.stack([(miss(step) - gap) / nudge for step in nudge * np.eye(size)], axis=1)
    for _ in range(MAX_TURNS):
        if np.linalg.norm(slopes, -2) < RESONANT:
            break
        step = np.linalg.solve(slopes, -gap)
        x, last = x + step, gap
        gap = miss(x)
        if np.abs(gap).max() <= PERIODIC * max(peak(), np.abs(x).max()):
            break
        slopes += np.outer(gap - last - slopes @ step, step) / (step @ step)
    return x, gap, float(np.linalg.norm(slopes, -2))
