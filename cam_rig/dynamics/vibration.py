"""Residual and torsional vibration of cams in their steady state (figs. 4-6 and 9 of the paper)."""

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

#: A piece whose ordinates differ by no more than this fraction of the lift is flat, ...
FLAT = 1e-12
#: ... and low where it is no higher than this fraction above the lowest ordinate: a spline through
#: readings that leaves its dwell may dip below it by part of their scatter.
LOW = 1e-3
#: In place of the low dwell of a law without one: this much (rad) about its lowest lift, as wide
#: as the low dwell of the paper's other laws here.
STAND_IN = float(np.radians(62.5))


@dataclass(frozen=True)
class LowDwell:
    """The stretch of the turn in which residual vibration is read."""

    start: float  #: rad
    span: float  #: rad
    dwell: bool  #: whether it rests

    @property
    def middle(self) -> float:
        """Cam angle (rad) of its middle, in the turn."""
        return (self.start + 0.5 * self.span) % TURN

    def holds(self, angle: FloatArray) -> NDArray[np.bool_]:
        """Which cam angles (rad) lie inside, the end not among them."""
        return np.asarray((angle - self.start) % TURN < self.span * (1.0 - 1e-9))


def low_dwell(law: Law) -> LowDwell:
    """The longest run of pieces at the lowest lift, around the turn; else the stand-in."""
    lowest = float(law.ordinates.min())
    low = law.ordinates.max(axis=0) - lowest <= LOW * law.lift
    flat = low & (np.ptp(law.ordinates, axis=0) <= FLAT * law.lift)
    best = LowDwell(0.0, 0.0, True)
    count = flat.size
    for i in np.flatnonzero(flat & ~np.roll(flat, 1)):
        run = 1
        while flat[(i + run) % count] and run < count:
            run += 1
        span = float(sum(law.spans[(i + k) % count] for k in range(run)))
        if span > best.span:
            best = LowDwell(float(law.breaks[i]), span, True)
    if best.span > 0.0:
        return best
    middle = extremes(law, 0)[0].angle
    return LowDwell((middle - 0.5 * STAND_IN) % TURN, STAND_IN, False)


#: Instants of a turn.
SAMPLES = 4096


@dataclass(frozen=True)
class FlywheelTurn:
    """One turn of a cam on its shaft in steady state, driven by a constant torque."""

    inertia: float  #: I_v, kg·m²
    fluctuation: float  #: (fastest − slowest)/mean speed of the flywheel
    cam_fluctuation: float  #: and of the cam
    formula: float  #: the handbook's ΔE/((I_v + I) ω²), shaft rigid, load as at even speed
    twist: float  #: rad, peak to peak
    torque: float  #: N·m, of the motor


def flywheel_turn(
    law: Law, shaft: TorsionalParameters, inertia: float, speed: float
) -> FlywheelTurn:
    """A turn at the mean ``speed`` (rad/s) behind a flywheel of ``inertia`` (kg·m²)."""
    held = math.isinf(inertia)
    behind = replace(shaft, flywheel_inertia=None if held else inertia)
    motion = steady_motion(law, behind, speed)
    times = np.linspace(0.0, motion.stop_time, SAMPLES)
    rows = motion.at(times)
    torque = (
        -float(np.mean(motion.shaft_torque(times[:-1]))) if held else motion.parameters.motor_torque
    )
    return FlywheelTurn(
        inertia=inertia,
        fluctuation=float(np.ptp(motion.lead(times)[1])) / speed,
        cam_fluctuation=float(np.ptp(rows[3])) / speed,
        formula=energy_fluctuation(law, shaft, speed) / ((inertia + shaft.cam_inertia) * speed**2),
        twist=float(np.ptp(rows[0])),
        torque=torque,
    )


def energy_fluctuation(law: Law, shaft: TorsionalParameters, speed: float) -> float:
    """Peak to peak ∫(T_mean − T) dθ (J) at even speed, T = (m ω² s'' + c ω s' + k s + F₀) s'."""
    f = shaft.follower
    angles = np.linspace(0.0, TURN, SAMPLES + 1)
    s, s1 = law(angles), law(angles, 1)
    loss = 0.5 * (s1[1:] ** 2 + s1[:-1] ** 2) * f.damping * speed * (TURN / SAMPLES)
    taken = np.concatenate([[0.0], np.cumsum(loss)])
    taken -= taken[-1] * angles / TURN
    taken += 0.5 * (f.mass * speed**2 * s1**2 + f.spring_stiffness * s**2) + f.preload * s
    return float(np.ptp(taken))


#: Least natural periods of the stem a turn: below, free and forced vibration cannot be told apart.
PERIODS = 3.0
#: Slowest and fastest speed, rpm; below, a turn has more periods of the stem than can be sampled.
SLOWEST, FASTEST = 1.0, 1e5


def fastest(follower: FollowerParameters) -> float:
    """Highest speed (rpm) with a residual vibration: `PERIODS` of the stem fit in a turn."""
    stiffness = follower.spring_stiffness + follower.stem
    return min(FASTEST, math.sqrt(stiffness / follower.mass) / PERIODS / RPM)


def require_speeds(follower: FollowerParameters, rpm: Iterable[float]) -> None:
    """Refuse speeds (rpm) that are too slow to sample, or too fast for the stem."""
    most = fastest(follower)
    for speed in rpm:
        if not SLOWEST <= speed * (1.0 + 1e-12) <= most * (1.0 + 2e-12):
            raise ConfigError(
                f"speed is {speed:g} rpm; allowed: {SLOWEST:g} to {most:.4g} rpm on this stem, "
                f"of which {PERIODS:g} periods must fit in a turn"
            )


#: Samples of a turn at least, and of a period of the stem.
MIN_SAMPLES, PER_PERIOD = 4096, 32
#: Free vibration beyond this many times all of the vibration is not part of it.
MAX_RINGING = 2.0
#: Samples of a turn of twist.
TWIST_SAMPLES = 2048


@dataclass(frozen=True, eq=False)
class SteadyTurn:
    """One turn of eq. 5 in steady state, ``(n,)`` each."""

    angle: FloatArray  #: of the cam, rad
    displacement: FloatArray  #: x, m
    acceleration: FloatArray  #: ẍ, m/s²
    vibration: FloatArray  #: r about the static share of the lift, m


def steady_turn(law: Law, follower: FollowerParameters, speed: float) -> SteadyTurn:
    """One turn at ``speed`` (rad/s), finely sampled."""
    model, out = response(law, follower, speed), outputs(follower)
    rate = math.sqrt(-model.matrix[1, 0])
    count = max(MIN_SAMPLES, math.ceil(PER_PERIOD * rate / speed))
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
    """What a cam does to its follower and its shaft at one speed, in steady state."""

    window: LowDwell  #: where residual vibration is read
    residual_amplitude: float  #: m, largest free vibration in the window, excited by the joints
    peak_to_peak: float  #: m, of x about the static share of the lift there
    acceleration: float  #: m/s², largest |ẍ|
    rigid_acceleration: float  #: m/s², that of the law itself
    twist: float | None  #: rad, peak to peak of cam less flywheel; None for a rig without a shaft
    #: (fastest − slowest)/mean speed of the flywheel; None where it holds its speed
    fluctuation: float | None = None


def vibration(
    law: Law, follower: FollowerParameters, shaft: TorsionalParameters | None, speed: float
) -> SteadyVibration:
    """All measures of one cam at ``speed`` (rad/s)."""
    if shaft is not None:
        require_smooth(law, ", or a rig without a shaft")
    turn, window = steady_turn(law, follower, speed), low_dwell(law)
    inside = turn.vibration[window.holds(turn.angle)]
    twist = fluctuation = None
    if shaft is not None and shaft.flywheel_inertia is not None:
        behind = flywheel_turn(law, shaft, shaft.flywheel_inertia, speed)
        twist, fluctuation = behind.twist, behind.fluctuation
    elif shaft is not None:
        twist = float(np.ptp(steady_twist(law, shaft, speed)[1]))
    return SteadyVibration(
        window=window,
        residual_amplitude=float(residual_vibration(law, follower, np.array([speed]))[0]),
        peak_to_peak=float(np.ptp(inside)),
        acceleration=float(np.abs(turn.acceleration).max()),
        rigid_acceleration=abs(peak(law, 2).value) * speed**2,
        twist=twist,
        fluctuation=fluctuation,
    )


def residual_vibration(
    law: Law, follower: FollowerParameters, speeds: FloatArray, window: LowDwell | None = None
) -> FloatArray:
    """Largest free vibration (m) in the low dwell, or another window, at speeds (rad/s), ``(m,)``.

    Free vibration decays between joints, so it is largest where the window begins or at a joint
    inside it.
    """
    require_speeds(follower, speeds / RPM)
    window = window or low_dwell(law)
    at = [window.start, *law.breaks[:-1][window.holds(law.breaks[:-1])].tolist()]
    run = ModalRun.of(response(law, follower, float(speeds[0])), outputs(follower), None)
    found = np.array([max(free_amplitude(run, x, angle) for angle in at) for x in speeds.tolist()])
    last = int(np.argmax(speeds))  # the faster, the less of the vibration follows the law
    whole = float(np.abs(steady_turn(law, follower, float(speeds[last])).vibration).max())
    if not found[last] <= MAX_RINGING * whole:
        raise DynamicsError(
            f"law {law.name!r}: residual vibration of {1e6 * found[last]:.3g} µm in a vibration of "
            f"{1e6 * whole:.3g} µm at {speeds[last] / RPM:g} rpm; allowed: speeds slow enough for "
            "the stem to follow the law"
        )
    return np.asarray(found)


#: Two rates nearer than this part of them are moved apart: critical damping has but one.
APART = 1e-7


def free_amplitude(run: ModalRun, speed: float, angle: float) -> float:
    """Amplitude of the output's free vibration at a cam angle (rad) in steady state.

    Of Σ a (1, λ) e^{λt} = (η, η̇) with the two rates λ, complex or real.
    """
    mode, (place, velocity) = run.mode, run.steady(speed, angle)
    half, most = 0.5 * mode.damping, math.sqrt(mode.stiffness)
    apart = cmath.sqrt(half**2 - mode.stiffness)
    apart = apart if abs(apart) > APART * most else complex(APART * most)
    rates = apart - half, -apart - half
    one = (velocity - rates[1] * place) * (mode.per_displacement + mode.per_velocity * rates[0])
    other = (velocity - rates[0] * place) * (mode.per_displacement + mode.per_velocity * rates[1])
    return float((abs(one) + abs(other)) / abs(2.0 * apart))


def steady_twist(
    law: Law, shaft: TorsionalParameters, speed: float
) -> tuple[FloatArray, FloatArray]:
    """Flywheel angle and twist ψ (rad), ``(n,)`` each, over one turn in steady state."""
    motion = steady_motion(law, shaft, speed)
    times = np.linspace(0.0, motion.stop_time, TWIST_SAMPLES)
    return speed * times, motion.at(times)[0]
