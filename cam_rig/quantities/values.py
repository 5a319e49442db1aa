"""What a law on a rig comes to by each quantity, exactly, whatever law it is."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cam_rig.acoustics import RadiationParameters
from cam_rig.acoustics.pressure import level_db, mean_square_rate, pressure_pa
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.any_follower import AnyFollower, find_jump, follower_of
from cam_rig.dynamics.jump.two_masses import NoJumpSpeedError
from cam_rig.dynamics.kinetostatic import force_extremes
from cam_rig.dynamics.steady_rules import FORCE_RTOL, MAX_FORCE_TURNS
from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.dynamics.vibration import low_dwell, residual_vibration, steady_twist
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.laws.law import peak
from cam_rig.profile.checks import sharpest_convex
from cam_rig.profile.contact import Motion, Scan, zoom
from cam_rig.profile.disc import discs
from cam_rig.quantities.steady import scene_at, steady_row
from cam_rig.quantities.terms import Sense, Term
from cam_rig.schema import CamConfig, RigConfig, SceneConfig
from cam_rig.simulation.by_speed import SpeedRow
from cam_rig.simulation.simulate import Acoustics, settled_turns
from cam_rig.units import RPM, TURN, FloatArray

#: Speeds of a range, at which its level or its largest vibration is taken; with landings fewer, as
#: a turn of each is simulated.
SPEEDS, SPEEDS_WITH_JUMPS = 41, 13
#: Gauss points of a cell of a piece, and the phase (rad) of the vibration in it at most.
GAUSS, CELL_PHASE = 12, 2.0
#: Peaks that are looked at are no farther below what is allowed, on the grid.
MISSED = 0.01
#: Speeds a beat: the largest between two of them is missed by 0.4 % at most; and of a range, most.
A_BEAT, MAX_SPEEDS = 32, 4096


@dataclass(frozen=True, eq=False)
class Subject:
    """A law on a rig; its cam says what the follower is, ``events`` what lies between the dwells.

    These have start and span (rad); ``scene`` is how it is run where a quantity is of a run.
    ``nominal`` is the law without errors of its profile, which leave no dwell at rest.
    """

    law: Law
    rig: RigConfig
    cam: CamConfig
    events: Sequence[tuple[float, float]] = ()
    scene: SceneConfig | None = None
    nominal: Law | None = None
    _runs: dict[float, tuple[SpeedRow, bool]] = field(default_factory=dict)

    @cached_property
    def rigid(self) -> FollowerParameters:
        """The follower as one rigid mass."""
        return FollowerParameters.from_rig(self.rig)

    def run(self, speed: float) -> SpeedRow:
        """The settled turns at one speed (rad/s), run once for all quantities of them."""
        assert self.scene is not None  # of quantities of a run
        if speed not in self._runs:
            scene = scene_at(self.scene, speed)
            self._runs[speed] = steady_row(self.law, self.rig, scene, speed)
        return self._runs[speed][0]

    def unsettled(self, term: Term) -> str:
        """Of which turns a quantity of a run is that never settles; empty for any other."""
        if self.scene is None or not term.quantity.of_run or self._runs[term.low][1]:
            return ""
        program = self.scene.program
        kept = program.turns.si - program.settle_turns.si
        return (
            f"at {term.low / RPM:.6g} rpm not settled to {FORCE_RTOL:g} in {MAX_FORCE_TURNS} "
            f"turns, so it is of the {kept:g} turns after them"
        )


def jump(one: Subject, follower: AnyFollower, duration: float | None) -> float:
    """Jump speed (rad/s) of a run from rest (s), or in steady state; 0 or ∞ where there is none."""
    if one.law.velocity_jumps:  # where the velocity jumps down the follower lifts off
        return 0.0
    try:
        return find_jump(one.law, follower, duration).speed
    except NoJumpSpeedError as none:
        return none.speed


def peak_of(order: int) -> Callable[..., float]:
    """The largest of a derivative of either sign."""
    return lambda one, *_: abs(peak(one.law, order).value)


def at_angles(order: int) -> Callable[[Subject, Term, Sense], float]:
    """A derivative's largest, or least, over a range of angles."""

    def value(one: Subject, term: Term, sense: Sense) -> float:
        law = one.law
        inside = law.breaks[(law.breaks > term.low) & (law.breaks < term.high)]
        values = law(np.append(inside, np.linspace(term.low, term.high, 4097)), order)
        return float(values.max() if sense == "<=" else values.min())

    return value


def rms_acceleration(one: Subject, *_: object) -> float:
    """Of s'' over the turn, by Gauss points, m/rad²."""
    law = one.law
    points, weights = np.polynomial.legendre.leggauss(law.degree + 1)
    table = bernstein.basis(law.degree, 0.5 * (points + 1.0))
    squares = (table @ law.derivative_ordinates(2)) ** 2
    return math.sqrt(float((0.5 * weights @ squares) @ law.spans) / TURN)


def forces(one: Subject, term: Term) -> list[tuple[float, float]]:
    """Least and largest contact force (N) of one rigid mass at the ends of a range of speeds."""
    return [force_extremes(one.law, one.rigid, speed) for speed in {term.low, term.high}]


def span(one: Subject, term: Term, _: Sense) -> float:
    """Of an event, rad."""
    if term.event > len(one.events):
        count = len(one.events)
        raise ConfigError(f"{term.key}: {one.cam.name!r} has {count} events; allowed: 1 to that")
    return one.events[term.event - 1][1]


def twist(one: Subject, term: Term, _: Sense) -> float:
    """Of the shaft in steady state, peak to peak, rad."""
    return float(np.ptp(steady_twist(one.law, shaft_of(one.rig), term.low)[1]))


# Residual vibration: the end mass vibrates about its static place, η̈ + 2ζω η̇ + ω² η = d₁ ṡ + d₂ s̈.


@dataclass(frozen=True)
class VibrationMode:
    """One mode in contact: λ (1/s, of positive imaginary part), its drive by ṡ and s̈, its force.

    ``drive`` is d₁ (1/s) and d₂. To the contact force η and η̇ add ``state`` (N/m, N·s/m), s, ṡ and
    s̈ ``motion``, and ``constant`` (N) is there always.
    """

    rate: complex
    drive: tuple[float, float]
    state: tuple[float, float]
    motion: tuple[float, float, float]
    constant: float

    @property
    def shown(self) -> complex:
        """What an amplitude adds to the contact force, half of it."""
        return self.state[0] + self.state[1] * self.rate

    @classmethod
    def of(cls, p: TwoMassParameters | FollowerParameters) -> VibrationMode:
        """Of two masses, or of one on its elastic stem (eq. 5 of the paper)."""
        if isinstance(p, TwoMassParameters):
            mass, stiffness = p.end_mass, p.stiffness
            damping, share, roller = p.stem_damping + p.damping, p.share, p.roller_mass
            stem, stem_damping, pressed = p.stem_stiffness, p.stem_damping, p.share
        else:
            mass, stiffness = p.mass, p.spring_stiffness + p.stem
            damping, share, roller = p.damping, p.stem / stiffness, 0.0
            stem, stem_damping, pressed = p.stem, 0.0, 1.0
        half = 0.5 * damping / mass
        square = stiffness / mass - half**2
        if square <= 0.0:
            raise ConfigError(
                f"the stem does not vibrate: its damping is {damping:g} N·s/m; allowed for a "
                f"residual vibration: below {2.0 * math.sqrt(stiffness * mass):.4g} N·s/m"
            )
        left = p.spring_stiffness / stiffness
        return cls(
            rate=complex(-half, math.sqrt(square)),
            drive=((stem_damping - damping * share) / mass, -share),
            state=(-stem, -stem_damping),
            motion=(stem * left, stem_damping * left, roller),
            constant=p.preload * pressed,
        )


def speeds_of(mode: VibrationMode, longest: float, low: float, high: float) -> FloatArray:
    """Speeds (rad/s) of a range, falling and even in 1/Ω, so many a beat of an event (rad)."""
    if low == high:
        return np.array([low])
    beats = longest * mode.rate.imag * (1.0 / low - 1.0 / high) / TURN
    count = min(MAX_SPEEDS, max(8, math.ceil(beats * A_BEAT)))
    return np.asarray(1.0 / np.linspace(1.0 / high, 1.0 / low, count + 1))


def minima(values: FloatArray) -> NDArray[np.bool_]:
    """Which values are no higher than their neighbours."""
    padded = np.pad(values, 1, constant_values=np.inf)
    return (values <= padded[:-2]) & (values <= padded[2:])


def peaks(speeds: FloatArray, amplitudes: FloatArray, above: float) -> FloatArray:
    """Speeds (rad/s) of a curve's peaks, even in 1/Ω: of parabolas of its squares, or ends."""
    at = np.flatnonzero(minima(-amplitudes) & (amplitudes > above))
    inner = (at > 0) & (at < amplitudes.size - 1)
    below, here, beyond = (amplitudes[(at[inner] + k)] ** 2 for k in (-1, 0, 1))
    curved = 2.0 * here - below - beyond
    shift = np.divide(0.5 * (beyond - below), curved, out=np.zeros(curved.size), where=curved > 0.0)
    found = 1.0 / speeds[at]
    found[inner] += shift * (1.0 / speeds[at[inner] + 1] - found[inner])
    return np.asarray(1.0 / found)


def mode_of(rig: RigConfig) -> VibrationMode:
    """The mode in which the follower vibrates on its stem."""
    rig.need("stem_stiffness", "a goal or limit of vibration")
    return VibrationMode.of(follower_of(rig))


def residual(one: Subject, term: Term, _: Sense) -> float:
    """The largest amplitude (m) that an event alone leaves, at any speed of a range."""
    mode, highest = mode_of(one.rig), []
    speeds = speeds_of(mode, max(span for _, span in one.events), term.low, term.high)
    for start, length in one.events:
        ends = start, start + length
        found = left_by(mode, one.law, *ends, speeds)
        for speed in peaks(speeds, found, float(found.max()) * (1.0 - MISSED)):
            highest.append(float(left_by(mode, one.law, *ends, np.array([speed]))[0]))
    return max(highest)


def left_by(
    mode: VibrationMode, law: Law, start: float, end: float, speeds: FloatArray
) -> FloatArray:
    """Amplitude (m) that a law leaves between two angles (rad) from rest, at speeds (rad/s)."""
    edges = law.breaks[(law.breaks > start) & (law.breaks < end)]
    edges = np.array([start, *edges, end])
    most = CELL_PHASE * float(speeds.min()) / mode.rate.imag
    cut = [np.linspace(a, b, 2 + int((b - a) / most))[:-1] for a, b in pairwise(edges)]
    edges = np.append(np.concatenate(cut), end)
    points, weights = np.polynomial.legendre.leggauss(GAUSS)
    width = np.diff(edges)[:, None]
    angles = (edges[:-1, None] + 0.5 * width * (points + 1.0)).ravel()
    share = (0.5 * width * weights).ravel()
    _, slope, curvature = law.motion_at(angles) * share
    found = np.empty(speeds.size)
    for i, speed in enumerate(speeds.tolist()):
        fading = np.exp(mode.rate / speed * (end - angles))
        total = (mode.drive[0] * slope + mode.drive[1] * speed * curvature) @ fading
        found[i] = abs(total) / mode.rate.imag
    return found


def steady_residual(one: Subject, term: Term, _: Sense) -> float:
    """The largest free vibration (m) in the low dwell of a mass on its stem, in steady state."""
    count = 1 if term.low == term.high else SPEEDS
    speeds = np.linspace(term.low, term.high, count)
    follower = FollowerParameters.on_stem(one.rig, f"the measure {term.name}")
    window = low_dwell(one.nominal or one.law)
    return float(residual_vibration(one.law, follower, speeds, window).max())


def in_row(name: str) -> Callable[[Subject, Term, Sense], float]:
    """A number of the settled turns at a speed."""
    return lambda one, term, _: float(getattr(one.run(term.low), name))


def run_level(one: Subject, term: Term, _: Sense) -> float:
    """Of the settled turns at a speed."""
    one.rig.need_radiation(f"the measure {term.name}")
    level = one.run(term.low).level_db
    if level is None:
        raise DynamicsError(f"{term.key}: no settled turn to measure")
    return level


def rigid_level(one: Subject, term: Term, _: Sense) -> float:
    """Of the mean power over a range of speeds, of a mass that stays on the cam."""
    radiation = RadiationParameters.from_rig(one.rig, lands=False)
    rates = [
        mean_square_rate(one.law, one.rigid, radiation.corner_rate, speed)
        for speed in np.linspace(term.low, term.high, SPEEDS).tolist()
    ]
    return level_of(one.rig, term, math.sqrt(float(np.mean(rates))))


def _background(radiation: RadiationParameters, term: Term) -> float:
    speeds = np.linspace(term.low, term.high, SPEEDS)
    return float(np.mean([radiation.background_power(speed) for speed in speeds.tolist()]))


def level_of(rig: RigConfig, term: Term, rate: float) -> float:
    """The level (dB) of a mean square rate's root (N/s), with the background."""
    radiation = RadiationParameters.from_rig(rig, lands=False)
    power = _background(radiation, term) + (radiation.gain * rate) ** 2
    return float(level_db(np.array([math.sqrt(power)]))[0])


def rate_of(rig: RigConfig, term: Term, level: float) -> float:
    """The other way; not above zero where the background alone is as loud."""
    radiation = RadiationParameters.from_rig(rig, lands=False)
    power = float(pressure_pa(level)) ** 2 - _background(radiation, term)
    return math.copysign(math.sqrt(abs(power)), power) / radiation.gain


def level_with_jumps(one: Subject, term: Term, *_: object) -> float:
    """Of the mean power over a range of speeds, settled turns of one mass, with landings."""
    count = 1 if term.low == term.high else SPEEDS_WITH_JUMPS
    speeds = np.linspace(term.low, term.high, count)
    turns = settled_turns(one.law, "one_mass", one.rigid, speeds)
    levels = Acoustics(RadiationParameters.from_rig(one.rig)).levels(turns)
    power = float(np.mean(10.0 ** (0.1 * (levels - levels.max()))))
    return float(levels.max() + 10.0 * np.log10(power))


# What depends on s, s', s'' at one cam angle: torque and contour.

#: A quantity's branches ``(b, ...)`` of motions of one shape: the greatest is the worst.
Branches = Callable[[Motion], FloatArray]
#: Samples of a piece, at least, and of a turn; local maxima that are no lower than this part of
#: the greatest are found to rounding.
SAMPLES, SAMPLES_OF_TURN, NEARLY = 65, 4096, 0.02


def pressure_angle(one: Subject, *_: object) -> float:
    """The largest on any disc, rad."""
    return max(scan.greatest(lambda touch: np.abs(touch.pressure)).value for scan in _scans(one))


def least_radius(one: Subject, *_: object) -> float:
    """Of curvature on any disc where it is convex, m."""
    return min(float(sharpest_convex(scan).value) for scan in _scans(one))


def _scans(one: Subject) -> list[Scan]:
    return [Scan(one.law, plate.element) for plate in discs(one.cam.follower, one.law)]


def torque(one: Subject, term: Term, _: Sense) -> float:
    """The largest of either sign of one rigid mass at any speed of a range, N·m."""
    return max(value for value, _ in maxima(one.law, torques(one.rigid, term)))


def torques(p: FollowerParameters, term: Term) -> Branches:
    """±(k s + c Ω s' + m Ω² s'' + F₀) s' (eq. 8) at two speeds, and where it turns."""
    low, high = term.low, term.high

    def at(motion: Motion, speed: FloatArray) -> FloatArray:
        force = p.spring_stiffness * motion.s + p.preload
        force = force + (p.damping * motion.slope + p.mass * speed * motion.curvature) * speed
        return np.asarray(force * motion.slope)

    def branches(motion: Motion) -> FloatArray:
        found = [at(motion, np.full(motion.s.shape, speed)) for speed in dict.fromkeys((low, high))]
        if low < high:
            with np.errstate(divide="ignore", invalid="ignore"):
                turns = -0.5 * p.damping * motion.slope / (p.mass * motion.curvature)
            found.append(at(motion, np.clip(np.where(np.isnan(turns), low, turns), low, high)))
        return np.concatenate([found, np.negative(found)])

    return branches


def maxima(law: Law, branches: Branches) -> list[tuple[float, float]]:
    """Greatest value of all branches and angle (rad) of each piece near the turn's; ∞ for NaN."""
    count = max(SAMPLES, min(512, SAMPLES_OF_TURN // law.spans.size))
    u = np.linspace(0.0, 1.0, count)
    values = branches(Motion.on_pieces(law, u)).max(axis=0)
    if not np.isfinite(values).all():
        return [(np.inf, 0.0)]
    best = values.max(axis=0)
    near = best >= best.max() - NEARLY * abs(best.max())
    found = []
    for piece in np.flatnonzero(near).tolist():

        def curve(at: FloatArray, piece: int = piece) -> FloatArray:
            return np.asarray(branches(Motion.on_piece(law, piece, at)).max(axis=0))

        at, value = zoom(curve, float(u[values[:, piece].argmax()]), float(u[1]))
        found.append((value, float(law.breaks[piece] + at * law.spans[piece])))
    return found
