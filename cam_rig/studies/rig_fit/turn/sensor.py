"""What a force sensor with a resonance of its own shows of a steady contact force.

A turn that comes back to itself is a Fourier series; the sensor multiplies its order n by
1 / (1 + 2 i ζ r − r²), r = n Ω / ω₀. The blows of landings, which no sample of the force itself
holds, are among it.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from cam_rig.arrays import FloatArray
from cam_rig.studies.rig_fit.turn.steady_turn import PeriodicTurn
from cam_rig.units import TURN

#: Cam angles at which the force of a turn is taken.
POINTS = 8192
#: On either side of a landing, rad.
BESIDE = 1e-9


def resonant(
    turn: PeriodicTurn, speed: float, frequency: float, ratio: float
) -> Callable[[FloatArray], FloatArray]:
    """The force (N) that the sensor shows, over the cam angle (rad).

    Parameters
    ----------
    speed : rad/s
    frequency, ratio : of the sensor, Hz, and its damping ratio
    """
    width = TURN / POINTS
    angles = width * np.arange(float(POINTS))
    orders = np.arange(POINTS // 2 + 1.0)
    force = turn.at(angles)[1]
    landings = [event for event in turn.events if event.kind == "landing"]
    for event in landings:
        _share(force, turn, math.fmod(event.angle, TURN), width)
    spectrum = np.fft.rfft(force)
    for event in landings:  # N·s over the time of one point
        height = event.impulse * speed / width
        spectrum += height * np.exp(-1j * orders * math.fmod(event.angle, TURN))
    r = orders * speed / (TURN * frequency)
    shown = np.fft.irfft(spectrum / (1.0 - r**2 + 2j * ratio * r), POINTS)
    curve = CubicSpline(np.append(angles, TURN), np.append(shown, shown[0]), bc_type="periodic")
    return lambda angle: np.asarray(curve(np.mod(angle, TURN)))


def _share(force: FloatArray, turn: PeriodicTurn, angle: float, width: float) -> None:
    """Let the point beside a landing at an angle (rad) have its part of the force on either side.

    So what is shown changes steadily with where the landing is.
    """
    nearest = round(angle / width)
    before = nearest + 0.5 - angle / width
    sides = turn.at(np.array([angle - BESIDE, angle + BESIDE]))[1]
    force[nearest % force.size] = (1.0 - before) * sides[0] + before * sides[1]
