"""Speed fluctuation over the flywheel's inertia, beside eq. 10 of the paper, its limit I_v → ∞."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.dynamics.torsional.motion import solve
from cam_rig.dynamics.torsional.parameters import TorsionalParameters
from cam_rig.dynamics.torsional.steady import steady_state
from cam_rig.laws import Law
from cam_rig.studies.cam_set import CamSet
from cam_rig.units import RPM, TURN

#: Inertias of the table, kg·m²; infinity is eq. 10.
INERTIAS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 20.0, math.inf)
#: The inertia of the rig paper_flywheel, assumed there: a steel disc of 300 mm.
SHOWN = 0.2
#: Instants of a turn.
SAMPLES = 4096


@dataclass(frozen=True)
class FlywheelTurn:
    """One turn of a cam on its shaft in steady state, driven by a constant torque.

    Parameters
    ----------
    inertia : I_v, kg·m²
    fluctuation, cam_fluctuation : (fastest − slowest)/mean speed of flywheel and cam
    formula : the handbook's ΔE/((I_v + I) ω²), shaft rigid, load as at even speed
    twist : rad, peak to peak
    torque : N·m, of the motor
    """

    inertia: float
    fluctuation: float
    cam_fluctuation: float
    formula: float
    twist: float
    torque: float


@dataclass(frozen=True)
class FlywheelStudy:
    """Turns by cam over `INERTIAS` at one speed (rpm), and eq. 10's twist without preload (rad)."""

    rpm: float
    turns: dict[str, list[FlywheelTurn]]
    without_preload: dict[str, float]

    def at(self, cam: str, inertia: float) -> FlywheelTurn:
        """A cam's turn with one of the inertias."""
        return next(turn for turn in self.turns[cam] if turn.inertia == inertia)


def study_flywheel(cam_set: CamSet, rpm: float) -> FlywheelStudy | None:
    """Every cam behind every flywheel; None for a rig without a shaft.

    Raises
    ------
    DynamicsError : no steady state at this speed, or a law whose velocity jumps
    """
    if cam_set.rig.shaft is None:
        return None
    shaft = shaft_of(cam_set.rig)
    slack = replace(shaft, follower=replace(shaft.follower, preload=0.0))
    turns = {
        cam: [flywheel_turn(law, shaft, inertia, rpm * RPM) for inertia in INERTIAS]
        for cam, law in cam_set.laws.items()
    }
    bare = {
        cam: flywheel_turn(law, slack, math.inf, rpm * RPM).twist
        for cam, law in cam_set.laws.items()
    }
    return FlywheelStudy(rpm, turns, bare)


def flywheel_turn(
    law: Law, shaft: TorsionalParameters, inertia: float, speed: float
) -> FlywheelTurn:
    """A turn at the mean ``speed`` (rad/s) behind a flywheel of ``inertia`` (kg·m²).

    Raises
    ------
    DynamicsError : no steady state at this speed, or a law whose velocity jumps

    Examples
    --------
    >>> import cam_rig
    >>> law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    >>> shaft = shaft_of(cam_rig.load_rig("paper_table2"))
    >>> turn = flywheel_turn(law, shaft, 0.2, 300 * RPM)
    >>> round(turn.fluctuation, 4), round(turn.formula, 4)
    (0.0312, 0.0312)
    """
    held = math.isinf(inertia)
    behind = replace(shaft, flywheel_inertia=None if held else inertia)
    driven, start = steady_state(law, behind, speed)
    motion = solve(law, driven, start, 0.0, TURN / speed)
    times = np.linspace(0.0, motion.stop_time, SAMPLES)
    rows = motion.at(times)
    torque = -float(np.mean(motion.shaft_torque(times[:-1]))) if held else driven.motor_torque
    return FlywheelTurn(
        inertia=inertia,
        fluctuation=float(np.ptp(motion.lead(times)[1])) / speed,
        cam_fluctuation=float(np.ptp(rows[3])) / speed,
        formula=energy_fluctuation(law, shaft, speed) / ((inertia + shaft.cam_inertia) * speed**2),
        twist=float(np.ptp(rows[0])),
        torque=torque,
    )


def energy_fluctuation(law: Law, shaft: TorsionalParameters, speed: float) -> float:
    """ΔE (J): largest less smallest surplus of work in a turn at even ``speed`` (rad/s).

    The surplus is ∫(T_mean − T) dθ of the cam's torque T = (m ω² s'' + c ω s' + k s + F₀) s'.
    """
    f = shaft.follower
    angles = np.linspace(0.0, TURN, SAMPLES + 1)
    s, s1 = law(angles), law(angles, 1)
    loss = 0.5 * (s1[1:] ** 2 + s1[:-1] ** 2) * f.damping * speed * (TURN / SAMPLES)
    taken = np.concatenate([[0.0], np.cumsum(loss)])
    taken -= taken[-1] * angles / TURN
    taken += 0.5 * (f.mass * speed**2 * s1**2 + f.spring_stiffness * s**2) + f.preload * s
    return float(np.ptp(taken))
