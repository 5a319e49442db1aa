"""Residual and torsional vibration in steady state (paper, figs. 4-6 and 9).

The residual vibration is the free vibration of the follower in a dwell of the cam. The torsional
vibration is the twist of the shaft between cam and flywheel.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics.elastic_stem import outputs, response
from cam_rig.dynamics.linear.response import sample
from cam_rig.dynamics.modal.run import ModalRun
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.torsional.model import TorsionalParameters
from cam_rig.dynamics.torsional.motion import steady_motion
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws import Law
from cam_rig.laws.law import extremes, peak
from cam_rig.units import RPM, TURN, FloatArray

#: Largest difference between the Bernstein ordinates of a piece of the law that counts as flat,
#: relative to the lift.
FLAT_RTOL = 1e-12
#: Largest height of a polynomial piece above the lowest ordinate of the law at which the piece may
#: belong to the low dwell, relative to the lift. A spline through gauge readings may dip below its
#: dwell by a fraction of their scatter.
LOW_RTOL = 1e-3
#: Range of cam angles (rad) around the lowest lift in which the residual vibration is evaluated if
#: the law has no low dwell. It is the width of the low dwell of the other laws of the paper in this
#: project.
DEFAULT_WINDOW_RAD = float(np.radians(62.5))


@dataclass(frozen=True)
class LowDwell:
    """Range of cam angles in which the residual vibration is evaluated.

    It is the low dwell of the law, or a range around its lowest lift.
    """

    start: float  #: cam angle at the start of the window, rad
    span: float  #: cam angle that the window covers, rad
    dwell: (
        bool  #: True if it is a dwell of the law, False for a window of width `DEFAULT_WINDOW_RAD`
    )

    @property
    def middle(self) -> float:
        """Cam angle in the middle of the low dwell, in [0, 2π), rad."""
        return (self.start + 0.5 * self.span) % TURN

    def contains(self, angle: FloatArray) -> NDArray[np.bool_]:
        """Return an array that is True for each cam angle (rad) in the window.

        The end of the window is not included.
        """
        return np.asarray((angle - self.start) % TURN < self.span * (1.0 - 1e-9))


def low_dwell(law: Law) -> LowDwell:
    """Return the longest low dwell of a law, as a range of cam angles.

    A low dwell consists of adjacent pieces of constant lift at the lowest lift. If the law has
    none, the result is a range of width `DEFAULT_WINDOW_RAD` around its lowest lift.
    """
    lowest = float(law.ordinates.min())
    low = law.ordinates.max(axis=0) - lowest <= LOW_RTOL * law.lift
    flat = low & (np.ptp(law.ordinates, axis=0) <= FLAT_RTOL * law.lift)
    longest = LowDwell(0.0, 0.0, True)
    count = flat.size
    for i in np.flatnonzero(flat & ~np.roll(flat, 1)):
        run = 1
        while flat[(i + run) % count] and run < count:
            run += 1
        span = float(sum(law.spans[(i + k) % count] for k in range(run)))
        if span > longest.span:
            longest = LowDwell(float(law.breaks[i]), span, True)
    if longest.span > 0.0:
        return longest
    middle = extremes(law, 0)[0].angle
    return LowDwell((middle - 0.5 * DEFAULT_WINDOW_RAD) % TURN, DEFAULT_WINDOW_RAD, False)


#: Number of times in a turn of the flywheel at which its speed and its load are evaluated.
SAMPLES = 4096


@dataclass(frozen=True)
class FlywheelTurn:
    """Steady turn of a cam on its shaft, driven by a constant motor torque."""

    inertia: float  #: moment of inertia I_v of the flywheel, kg·m², infinite at constant speed
    fluctuation: float  #: speed fluctuation (max − min)/mean of the flywheel
    cam_fluctuation: float  #: speed fluctuation (max − min)/mean of the cam
    #: Speed fluctuation by the handbook formula ΔE/((I_v + I) ω²), which assumes a rigid shaft and
    #: the load at constant speed. ΔE is that of `energy_fluctuation`.
    formula: float
    twist: float  #: peak-to-peak twist of the shaft, rad
    torque: float  #: torque of the motor, N·m


def flywheel_turn(
    law: Law, shaft: TorsionalParameters, inertia: float, speed: float
) -> FlywheelTurn:
    """Return the steady turn of a cam on its shaft with a flywheel.

    ``inertia`` is that of the flywheel, kg·m². An infinite inertia is a flywheel at constant speed.
    ``speed`` is the mean speed, rad/s.
    """
    is_infinite = math.isinf(inertia)
    shaft_with_flywheel = replace(shaft, flywheel_inertia=None if is_infinite else inertia)
    motion = steady_motion(law, shaft_with_flywheel, speed)
    times = np.linspace(0.0, motion.stop_time, SAMPLES)
    rows = motion.at(times)
    torque = motion.parameters.motor_torque
    if is_infinite:
        torque = -float(np.mean(motion.shaft_torque(times[:-1])))
    return FlywheelTurn(
        inertia=inertia,
        fluctuation=float(np.ptp(motion.lead(times)[1])) / speed,
        cam_fluctuation=float(np.ptp(rows[3])) / speed,
        formula=energy_fluctuation(law, shaft, speed) / ((inertia + shaft.cam_inertia) * speed**2),
        twist=float(np.ptp(rows[0])),
        torque=torque,
    )


def energy_fluctuation(law: Law, shaft: TorsionalParameters, speed: float) -> float:
    """Return the fluctuation ΔE (J) of the flywheel's energy in a turn.

    The load is that of a rigid shaft at the constant ``speed`` ω (rad/s). ΔE is the peak-to-peak
    value of ∫(T_mean − T) dθ with the torque of the load T = (m ω² s'' + c ω s' + k s + F₀) s'.
    """
    f = shaft.follower
    angles = np.linspace(0.0, TURN, SAMPLES + 1)
    s, s1 = law(angles), law(angles, 1)
    loss = 0.5 * (s1[1:] ** 2 + s1[:-1] ** 2) * f.damping * speed * (TURN / SAMPLES)
    energy = np.concatenate([[0.0], np.cumsum(loss)])
    energy -= energy[-1] * angles / TURN
    energy += 0.5 * (f.mass * speed**2 * s1**2 + f.spring_stiffness * s**2) + f.preload * s
    return float(np.ptp(energy))


#: Smallest number of natural periods of the stem per turn at which the residual vibration is
#: computed. With fewer periods, free and forced vibration cannot be separated.
MIN_PERIODS = 3.0
#: Lowest cam speed at which vibration is computed, rpm. At lower speeds a turn has more periods of
#: the stem than can be sampled.
MIN_RPM = 1.0
#: Highest cam speed at which vibration is computed, rpm.
MAX_RPM = 1e5


def find_max_rpm(follower: FollowerParameters) -> float:
    """Return the highest cam speed (rpm) at which the residual vibration is computed.

    At this speed `MIN_PERIODS` natural periods of the follower on its stem fit in one turn. The
    result is at most `MAX_RPM`.
    """
    stiffness = follower.spring_stiffness + follower.stem
    return min(MAX_RPM, math.sqrt(stiffness / follower.mass) / MIN_PERIODS / RPM)


def require_speeds(follower: FollowerParameters, rpm: Iterable[float]) -> None:
    """Raise a `ConfigError` if a cam speed (rpm) is too low or too high for the stem.

    The limits are `MIN_RPM` and the result of `find_max_rpm`.
    """
    max_rpm = find_max_rpm(follower)
    for speed in rpm:
        if not MIN_RPM <= speed * (1.0 + 1e-12) <= max_rpm * (1.0 + 2e-12):
            raise ConfigError(
                f"speed is {speed:g} rpm; allowed: {MIN_RPM:g} to {max_rpm:.4g} rpm on this stem, "
                f"of which {MIN_PERIODS:g} periods must fit in a turn"
            )


#: Smallest number of samples of the follower's vibration per turn of the cam.
MIN_SAMPLES = 4096
#: Smallest number of samples of the follower's vibration per natural period on its stem.
SAMPLES_PER_PERIOD = 32
#: Largest accepted ratio of the residual (free) vibration to the whole vibration. A larger free
#: vibration is an artefact: at this speed the mass on its stem does not follow the law.
MAX_RESIDUAL_RATIO = 2.0
#: Number of samples of the shaft's twist per turn.
TWIST_SAMPLES = 2048


@dataclass(frozen=True, eq=False)
class SteadyTurn:
    """Samples of one turn of a mass on its stem in steady state, ``(n,)`` each.

    The equation of motion is eq. 5 of the paper.
    """

    angle: FloatArray  #: cam angle, rad
    displacement: FloatArray  #: displacement x of the mass, m
    acceleration: FloatArray  #: acceleration ẍ of the mass, m/s²
    vibration: FloatArray  #: vibration r = x − α s about the static fraction of the lift, m


def steady_turn(law: Law, follower: FollowerParameters, speed: float) -> SteadyTurn:
    """Return the samples of a turn of a mass on its stem in steady state.

    ``follower`` must have a stem stiffness. ``speed`` is the cam speed, rad/s.
    """
    model, out = response(law, follower, speed), outputs(follower)
    rate = math.sqrt(-model.matrix[1, 0])
    count = max(MIN_SAMPLES, math.ceil(SAMPLES_PER_PERIOD * rate / speed))
    step = TURN / speed / count
    displacement, _, acceleration, force = sample(
        model, model.periodic(), 0.0, 0.0, step, count, out
    )
    vibration = -(force - follower.preload) / follower.stem
    angle = speed * step * np.arange(count, dtype=np.float64)
    share = follower.spring_stiffness / (follower.spring_stiffness + follower.stem)
    vibration += share * law(angle)
    return SteadyTurn(angle, displacement, acceleration, vibration)


@dataclass(frozen=True)
class SteadyVibration:
    """Steady vibration of the follower and the shaft of a cam at one speed."""

    window: LowDwell  #: range of cam angles in which the residual vibration is evaluated
    #: Largest amplitude of the free vibration in the low dwell, m. The joints between pieces of the
    #: law excite it.
    residual_amplitude: float
    #: Peak-to-peak vibration about the static fraction of the lift in the low dwell, m.
    peak_to_peak: float
    acceleration: float  #: largest |acceleration| of the mass on its stem, m/s²
    rigid_acceleration: float  #: largest acceleration of the law itself, m/s²
    #: Peak-to-peak twist of the shaft (cam angle less flywheel angle), rad. None for a rig without
    #: a shaft.
    twist: float | None
    #: Speed fluctuation (max − min)/mean of the flywheel. None if its speed is constant.
    fluctuation: float | None = None


def vibration(
    law: Law, follower: FollowerParameters, shaft: TorsionalParameters | None, speed: float
) -> SteadyVibration:
    """Return all measures of the vibration of one cam at a speed (rad/s).

    Parameters
    ----------
    law : Law
        The motion law of the cam.
    follower : FollowerParameters
        The follower, with a stem stiffness.
    shaft : TorsionalParameters, optional
        The shaft with its flywheel, or None for a rig without a shaft.
    speed : float
        Cam speed, rad/s.

    Returns
    -------
    SteadyVibration
        Measures in SI units.

    Raises
    ------
    ConfigError
        If the speed is out of the range of `require_speeds`, or the stem stiffness is None.
    DynamicsError
        If the law has a velocity jump and the rig has a shaft, or a steady state does not exist.

    References
    ----------
    Paper, eq. 5 and 10, figs. 4-6 and 9.
    """
    if shaft is not None:
        require_smooth(law, ", or a rig without a shaft")
    turn, window = steady_turn(law, follower, speed), low_dwell(law)
    inside = turn.vibration[window.contains(turn.angle)]
    twist, fluctuation = (None, None) if shaft is None else shaft_vibration(law, shaft, speed)
    return SteadyVibration(
        window=window,
        residual_amplitude=float(residual_vibration(law, follower, np.array([speed]))[0]),
        peak_to_peak=float(np.ptp(inside)),
        acceleration=float(np.abs(turn.acceleration).max()),
        rigid_acceleration=abs(peak(law, 2).value) * speed**2,
        twist=twist,
        fluctuation=fluctuation,
    )


def shaft_vibration(
    law: Law, shaft: TorsionalParameters, speed: float
) -> tuple[float, float | None]:
    """Return the peak-to-peak twist (rad) of a shaft, and the speed fluctuation of its flywheel.

    Both are those of a turn in steady state. The fluctuation is None if the flywheel has constant
    speed. ``speed`` is the mean speed, rad/s.
    """
    if shaft.flywheel_inertia is None:
        return float(np.ptp(steady_twist(law, shaft, speed)[1])), None
    turn = flywheel_turn(law, shaft, shaft.flywheel_inertia, speed)
    return turn.twist, turn.fluctuation


def residual_vibration(
    law: Law, follower: FollowerParameters, speeds: FloatArray, window: LowDwell | None = None
) -> FloatArray:
    """Return the amplitude (m) of the residual vibration at m cam speeds, ``(m,)``.

    It is the largest amplitude of the free vibration in a range of cam angles, the window. The free
    vibration decays between the joints of the law, so it is largest at the start of the window or
    at a joint inside it.

    Parameters
    ----------
    law : Law
        The motion law of the cam.
    follower : FollowerParameters
        The follower, with a stem stiffness.
    speeds : array, ``(m,)``
        Cam speeds, rad/s.
    window : LowDwell, optional
        The range of cam angles (default: the low dwell of the law).

    Raises
    ------
    ConfigError
        If a speed is out of the range of `require_speeds`.
    DynamicsError
        If the residual vibration exceeds the whole vibration by more than `MAX_RESIDUAL_RATIO`.
    """
    require_speeds(follower, speeds / RPM)
    window = window or low_dwell(law)
    angles = [window.start, *law.breaks[:-1][window.contains(law.breaks[:-1])].tolist()]
    run = ModalRun.of(response(law, follower, float(speeds[0])), outputs(follower), None)
    amplitudes = np.array(
        [max(free_amplitude(run, speed, angle) for angle in angles) for speed in speeds.tolist()]
    )
    # The highest speed is checked, because there the mass on its stem follows the law least.
    last = int(np.argmax(speeds))
    total = float(np.abs(steady_turn(law, follower, float(speeds[last])).vibration).max())
    if not amplitudes[last] <= MAX_RESIDUAL_RATIO * total:
        raise DynamicsError(
            f"law {law.name!r}: residual vibration of {1e6 * amplitudes[last]:.3g} µm in a "
            f"vibration of {1e6 * total:.3g} µm at {speeds[last] / RPM:g} rpm; allowed: speeds "
            "slow enough for the stem to follow the law"
        )
    return np.asarray(amplitudes)


#: Smallest value of |√(δ² − κ)| relative to √κ for a mode η̈ + 2δ η̇ + κ η = 0. At critical damping
#: its two eigenvalues are equal, and a smaller value is replaced by this one, so that they differ.
MIN_RATE_DIFFERENCE = 1e-7


def free_amplitude(run: ModalRun, speed: float, angle: float) -> float:
    """Return the amplitude of the free vibration in a run's output at a cam angle.

    The run is in steady state at the cam speed ``speed`` (rad/s). ``angle`` is in rad. The free
    vibration is (η, η̇) = Σ a (1, λ) e^{λt} with two eigenvalues λ, complex or real. The amplitude
    of the output p η + q η̇ is Σ |a (p + q λ)|.
    """
    mode, (displacement, velocity) = run.mode, run.steady(speed, angle)
    p, q = mode.per_displacement, mode.per_velocity
    half, frequency = 0.5 * mode.damping, math.sqrt(mode.stiffness)
    root, min_root = cmath.sqrt(half**2 - mode.stiffness), MIN_RATE_DIFFERENCE * frequency
    root = root if abs(root) > min_root else complex(min_root)
    rates = root - half, -root - half
    first = (velocity - rates[1] * displacement) * (p + q * rates[0])
    second = (velocity - rates[0] * displacement) * (p + q * rates[1])
    return float((abs(first) + abs(second)) / abs(2.0 * root))


def steady_twist(
    law: Law, shaft: TorsionalParameters, speed: float
) -> tuple[FloatArray, FloatArray]:
    """Return flywheel angle (rad) and shaft twist (rad) over a turn, ``(n,)`` each.

    The turn is in steady state. ``speed`` is the mean speed, rad/s. n is `TWIST_SAMPLES`.
    """
    motion = steady_motion(law, shaft, speed)
    times = np.linspace(0.0, motion.stop_time, TWIST_SAMPLES)
    return speed * times, motion.at(times)[0]
