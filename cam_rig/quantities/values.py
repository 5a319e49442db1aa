"""Functions that compute the quantities of a law on a rig, exactly for every law.

`cam_rig.quantities.catalogue` assigns them to the names of the quantities.
"""

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
from cam_rig.simulation.simulate import Acoustics, simulate_steady_turns
from cam_rig.units import RPM, TURN, FloatArray

#: Number of speeds in a range of cam speeds at which a sound level, or the largest vibration in
#: steady state, is computed.
SPEEDS = 41
#: Number of speeds in a range of cam speeds at which a sound level with landings is computed. It is
#: smaller than `SPEEDS`, because turns are simulated at each speed.
SPEEDS_WITH_LANDINGS = 13
#: Number of Gauss points per cell of the integral for the residual vibration. The polynomial pieces
#: of a law are divided into cells.
GAUSS_POINTS = 12
#: Largest change (rad) of the vibration's phase within a cell of the integral.
MAX_CELL_PHASE = 2.0
#: A peak of the vibration over the speed is computed only if the value on the grid of speeds is
#: below the maximum, or below a limit, by at most this relative distance.
PEAK_SEARCH_RTOL = 0.01
#: Number of speeds per beat, the distance between two peaks of the residual vibration over the
#: speed. The largest amplitude between two of these speeds is higher by at most 0.4 %.
SPEEDS_PER_BEAT = 32
#: Largest number of speeds at which the residual vibration over a range of speeds is computed.
MAX_SPEEDS = 4096


@dataclass(frozen=True, eq=False)
class Subject:
    """Law on a rig, whose quantities are computed.

    Parameters
    ----------
    law : Law
        Motion law of the cam.
    rig : RigConfig
        Rig with the masses, springs and dampers of the follower.
    cam : CamConfig
        Cam with its base radius and the geometry of the follower.
    events : sequence of (float, float)
        Start and span (rad of cam angle) of the events, the motions between the dwells.
    scene : SceneConfig or None
        Scene for the quantities of a run, or None if there are none.
    nominal : Law or None
        Law without manufacturing errors, if ``law`` contains them. It has the dwells, because with
        the errors the follower is not at rest there. None if ``law`` has no errors.
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
        """Parameters of the follower as one rigid mass, without stem vibration."""
        return FollowerParameters.from_rig(self.rig)

    def run(self, speed: float) -> SpeedRow:
        """Return the results of the steady turns at a cam speed (rad/s).

        They are computed once for all quantities at this speed.
        """
        assert self.scene is not None  # set for quantities of a run
        if speed not in self._runs:
            scene = scene_at(self.scene, speed)
            self._runs[speed] = steady_row(self.law, self.rig, scene, speed)
        return self._runs[speed][0]

    def unsteady_note(self, term: Term) -> str:
        """Return a note if a quantity was measured in a run that is not steady.

        The text is empty if the run is steady, or if the quantity is not that of a run. The
        quantity must have been computed before.
        """
        if self.scene is None or not term.quantity.of_run or self._runs[term.low][1]:
            return ""
        schedule = self.scene.schedule
        measured = schedule.turns.si - schedule.transient_turns.si
        return (
            f"at {term.low / RPM:.6g} rpm not settled to {FORCE_RTOL:g} in {MAX_FORCE_TURNS} "
            f"turns, so the {measured:g} turns after them are measured"
        )


def jump(subject: Subject, follower: AnyFollower, duration: float | None) -> float:
    """Return the jump speed (rad/s), at which the follower loses contact.

    It is that of a run from rest of ``duration`` s, or in steady state if ``duration`` is None. The
    result is 0 if contact is lost at every speed, and ∞ if it is kept at every speed.
    """
    if subject.law.velocity_jumps:  # the follower lifts off where the velocity jumps down
        return 0.0
    try:
        return find_jump(subject.law, follower, duration).speed
    except NoJumpSpeedError as error:
        return error.speed


def peak_of(order: int) -> Callable[..., float]:
    """Return a function of a `Subject`: the largest magnitude of a derivative of s.

    `order` is the order of the derivative with respect to the cam angle. The value of the function
    is in m/rad^order.
    """
    return lambda subject, *_: abs(peak(subject.law, order).value)


def at_angles(order: int) -> Callable[[Subject, Term, Sense], float]:
    """Return a function that computes the extreme of s or a derivative over angles.

    `order` is the order of the derivative, 0 for s itself. The range of cam angles is that of the
    term. The value is the maximum for an upper limit ("<=") and the minimum for a lower limit.
    """

    def value(subject: Subject, term: Term, sense: Sense) -> float:
        law = subject.law
        inside = law.breaks[(law.breaks > term.low) & (law.breaks < term.high)]
        values = law(np.append(inside, np.linspace(term.low, term.high, 4097)), order)
        return float(values.max() if sense == "<=" else values.min())

    return value


def rms_acceleration(subject: Subject, *_: object) -> float:
    """Compute the r.m.s. of s'' over the turn in m/rad², exactly by Gauss quadrature."""
    law = subject.law
    points, weights = np.polynomial.legendre.leggauss(law.degree + 1)
    table = bernstein.basis(law.degree, 0.5 * (points + 1.0))
    squares = (table @ law.derivative_ordinates(2)) ** 2
    return math.sqrt(float((0.5 * weights @ squares) @ law.spans) / TURN)


def forces(subject: Subject, term: Term) -> list[tuple[float, float]]:
    """Return the smallest and the largest contact force (N) of one rigid mass over a turn.

    The list has one pair for each end of the term's range of speeds, and a single pair if they are
    equal. The mass stays on the cam, so a force may be negative.
    """
    return [force_extremes(subject.law, subject.rigid, speed) for speed in {term.low, term.high}]


def span(subject: Subject, term: Term, _: Sense) -> float:
    """Return the span of an event, the motion between two dwells, in rad of cam angle.

    ``term`` contains the number of the event.

    Raises
    ------
    ConfigError
        If the cam has no event of this number.
    """
    if term.event > len(subject.events):
        count = len(subject.events)
        name = subject.cam.name
        raise ConfigError(f"{term.key}: cam {name!r} has {count} events; allowed: 1 to {count}")
    return subject.events[term.event - 1][1]


def twist(subject: Subject, term: Term, _: Sense) -> float:
    """Compute the peak-to-peak twist (rad) of the shaft in steady state.

    ``subject`` is the law on a rig, and ``term`` contains the cam speed.
    """
    return float(np.ptp(steady_twist(subject.law, shaft_of(subject.rig), term.low)[1]))


# Residual vibration η of the end mass about its static position.


@dataclass(frozen=True)
class VibrationMode:
    """Vibration mode of a follower in contact: η̈ + 2ζω η̇ + ω² η = d₁ ṡ + d₂ s̈.

    η is the vibration of the end mass about its static position.

    Parameters
    ----------
    rate : complex
        Eigenvalue λ of the mode, 1/s, with positive imaginary part.
    drive : (float, float)
        Coefficients d₁ (1/s) and d₂.
    state : (float, float)
        Contact force per η (N/m) and η̇ (N·s/m).
    motion : (float, float, float)
        Contact force per s (N/m), ṡ (N·s/m) and s̈ (kg).
    constant : float
        Contact force at rest, N.
    """

    rate: complex
    drive: tuple[float, float]
    state: tuple[float, float]
    motion: tuple[float, float, float]
    constant: float

    @property
    def force_factor(self) -> complex:
        """Complex contact force per complex amplitude of the mode, N/m.

        A vibration of complex amplitude a adds 2 Re(force_factor · a) to the contact force.
        """
        return self.state[0] + self.state[1] * self.rate

    @classmethod
    def of(cls, p: TwoMassParameters | FollowerParameters) -> VibrationMode:
        """Return the mode of two masses, or of one mass on its elastic stem.

        Raises
        ------
        ConfigError
            If the stem does not vibrate, because its damping is too large.

        References
        ----------
        Equation 5 of the paper.
        """
        if isinstance(p, TwoMassParameters):
            mass, stiffness = p.end_mass, p.stiffness
            damping, share, roller = p.stem_damping + p.damping, p.share, p.roller_mass
            stem, stem_damping, preload_share = p.stem_stiffness, p.stem_damping, p.share
        else:
            mass, stiffness = p.mass, p.spring_stiffness + p.stem
            damping, share, roller = p.damping, p.stem / stiffness, 0.0
            stem, stem_damping, preload_share = p.stem, 0.0, 1.0
        half = 0.5 * damping / mass
        square = stiffness / mass - half**2
        if square <= 0.0:
            raise ConfigError(
                f"the stem does not vibrate: its damping is {damping:g} N·s/m; allowed for a "
                f"residual vibration: below {2.0 * math.sqrt(stiffness * mass):.4g} N·s/m"
            )
        spring_share = p.spring_stiffness / stiffness
        return cls(
            rate=complex(-half, math.sqrt(square)),
            drive=((stem_damping - damping * share) / mass, -share),
            state=(-stem, -stem_damping),
            motion=(stem * spring_share, stem_damping * spring_share, roller),
            constant=p.preload * preload_share,
        )


def speeds_of(mode: VibrationMode, longest: float, low: float, high: float) -> FloatArray:
    """Return the cam speeds Ω (rad/s) at which vibration over a range is computed.

    They are in falling order from `high` to `low` and equally spaced in 1/Ω, ``(n,)``. There are
    `SPEEDS_PER_BEAT` speeds per beat, in which the mode vibrates once more during the longest event
    (``longest``, rad of cam angle). An event is the motion between two dwells.
    """
    if low == high:
        return np.array([low])
    beats = longest * mode.rate.imag * (1.0 / low - 1.0 / high) / TURN
    count = min(MAX_SPEEDS, max(8, math.ceil(beats * SPEEDS_PER_BEAT)))
    return np.asarray(1.0 / np.linspace(1.0 / high, 1.0 / low, count + 1))


def minima(values: FloatArray) -> NDArray[np.bool_]:
    """Return a mask ``(n,)`` that is True at the local minima of ``values`` ``(n,)``.

    A value that is equal to a neighbour counts as a minimum too. The ends can be minima.
    """
    padded = np.pad(values, 1, constant_values=np.inf)
    return (values <= padded[:-2]) & (values <= padded[2:])


def peaks(speeds: FloatArray, amplitudes: FloatArray, above: float) -> FloatArray:
    """Return the cam speeds Ω (rad/s) of the peaks of a vibration amplitude.

    The amplitudes are given at speeds that are equally spaced in 1/Ω. The speed of a peak is the
    vertex of the parabola through the squares of three adjacent amplitudes, or an end of the range.
    Peaks with an amplitude of at most ``above`` are omitted.
    """
    index = np.flatnonzero(minima(-amplitudes) & (amplitudes > above))
    inner = (index > 0) & (index < amplitudes.size - 1)
    below, middle, beyond = (amplitudes[(index[inner] + k)] ** 2 for k in (-1, 0, 1))
    curved = 2.0 * middle - below - beyond
    shift = np.divide(0.5 * (beyond - below), curved, out=np.zeros(curved.size), where=curved > 0.0)
    inverse = 1.0 / speeds[index]
    inverse[inner] += shift * (1.0 / speeds[index[inner] + 1] - inverse[inner])
    return np.asarray(1.0 / inverse)


def mode_of(rig: RigConfig) -> VibrationMode:
    """Return the mode in which the follower of a rig vibrates on its stem.

    Raises
    ------
    ConfigError
        If the rig has no stem stiffness, or the stem does not vibrate.
    """
    rig.need("stem_stiffness", "a goal or limit of vibration")
    return VibrationMode.of(follower_of(rig))


def residual(subject: Subject, term: Term, _: Sense) -> float:
    """Compute the largest residual vibration (m) after an event, over a range of speeds.

    The residual vibration is the amplitude of the mode at the end of an event, the motion between
    two dwells, that starts from rest. The result is the largest of all events. ``subject`` is the
    law on a rig, and ``term`` contains the range of speeds.
    """
    mode, highest = mode_of(subject.rig), []
    speeds = speeds_of(mode, max(span for _, span in subject.events), term.low, term.high)
    for start, length in subject.events:
        ends = start, start + length
        amplitudes = amplitude_after(mode, subject.law, *ends, speeds)
        for speed in peaks(speeds, amplitudes, float(amplitudes.max()) * (1.0 - PEAK_SEARCH_RTOL)):
            highest.append(float(amplitude_after(mode, subject.law, *ends, np.array([speed]))[0]))
    return max(highest)


def amplitude_after(
    mode: VibrationMode, law: Law, start: float, end: float, speeds: FloatArray
) -> FloatArray:
    """Compute the amplitudes (m) of a mode after an event, one per cam speed, ``(n,)``.

    The event is the motion of the law from cam angle ``start`` to ``end`` (rad). The mode is at
    rest at its start. ``speeds`` are n cam speeds, rad/s.
    """
    edges = law.breaks[(law.breaks > start) & (law.breaks < end)]
    edges = np.array([start, *edges, end])
    max_cell = MAX_CELL_PHASE * float(speeds.min()) / mode.rate.imag
    cut = [np.linspace(a, b, 2 + int((b - a) / max_cell))[:-1] for a, b in pairwise(edges)]
    edges = np.append(np.concatenate(cut), end)
    points, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    width = np.diff(edges)[:, None]
    angles = (edges[:-1, None] + 0.5 * width * (points + 1.0)).ravel()
    share = (0.5 * width * weights).ravel()
    _, slope, curvature = law.motion_at(angles) * share
    amplitudes = np.empty(speeds.size)
    for i, speed in enumerate(speeds.tolist()):
        decay = np.exp(mode.rate / speed * (end - angles))
        total = (mode.drive[0] * slope + mode.drive[1] * speed * curvature) @ decay
        amplitudes[i] = abs(total) / mode.rate.imag
    return amplitudes


def steady_residual(subject: Subject, term: Term, _: Sense) -> float:
    """Compute the residual vibration (m) of a mass on its stem in steady state.

    It is the largest amplitude of the free vibration in the low dwell, over the term's range of
    speeds.
    """
    count = 1 if term.low == term.high else SPEEDS
    speeds = np.linspace(term.low, term.high, count)
    follower = FollowerParameters.on_stem(subject.rig, f"the measure {term.name}")
    window = low_dwell(subject.nominal or subject.law)
    return float(residual_vibration(subject.law, follower, speeds, window).max())


def row_value(name: str) -> Callable[[Subject, Term, Sense], float]:
    """Return a function that reads one result of the steady turns at a speed.

    ``name`` is the field of the `SpeedRow`, such as ``min_force``. The speed is that of the term, a
    quantity with its domain.
    """
    return lambda subject, term, _: float(getattr(subject.run(term.low), name))


def run_level(subject: Subject, term: Term, _: Sense) -> float:
    """Return the sound level (dB) of the steady turns at the term's speed.

    Raises
    ------
    ConfigError
        If the rig has no radiation, the constants of its sound.
    DynamicsError
        If there is no turn after the transient turns.
    """
    subject.rig.need_radiation(f"the measure {term.name}")
    level = subject.run(term.low).level_db
    if level is None:
        raise DynamicsError(f"{term.key}: no settled turn to measure")
    return level


def rigid_level(subject: Subject, term: Term, _: Sense) -> float:
    """Compute the sound level (dB) of one rigid mass that stays on the cam.

    It is the level of the mean sound power over the term's range of speeds, at `SPEEDS` speeds.
    """
    radiation = RadiationParameters.from_rig(subject.rig, lands=False)
    rates = [
        mean_square_rate(subject.law, subject.rigid, radiation.corner_rate, speed)
        for speed in np.linspace(term.low, term.high, SPEEDS).tolist()
    ]
    return level_of(subject.rig, term, math.sqrt(float(np.mean(rates))))


def _background(radiation: RadiationParameters, term: Term) -> float:
    """Return the mean background sound power over a range of speeds, in Pa².

    It is the mean square of the sound pressure of motor and bearings, at `SPEEDS` speeds of the
    term.
    """
    speeds = np.linspace(term.low, term.high, SPEEDS)
    return float(np.mean([radiation.background_power(speed) for speed in speeds.tolist()]))


def level_of(rig: RigConfig, term: Term, rate: float) -> float:
    """Return the sound level (dB) of the background and of a changing contact force.

    ``rate`` is the r.m.s. rate of the contact force, N/s. The background is the mean over the
    term's range of speeds.
    """
    radiation = RadiationParameters.from_rig(rig, lands=False)
    power = _background(radiation, term) + (radiation.gain * rate) ** 2
    return float(level_db(np.array([math.sqrt(power)]))[0])


def rate_of(rig: RigConfig, term: Term, level: float) -> float:
    """Return the r.m.s. rate of the contact force (N/s) that causes a sound level (dB).

    This function is the inverse of `level_of`. The result is zero or negative if the background
    alone reaches the level.
    """
    radiation = RadiationParameters.from_rig(rig, lands=False)
    power = float(pressure_pa(level)) ** 2 - _background(radiation, term)
    return math.copysign(math.sqrt(abs(power)), power) / radiation.gain


def level_with_jumps(subject: Subject, term: Term, *_: object) -> float:
    """Compute the sound level (dB) of one rigid mass that may leave the cam.

    It is the level of the mean sound power over the term's range of speeds, at
    `SPEEDS_WITH_LANDINGS` speeds. The sound of landings is included.
    """
    count = 1 if term.low == term.high else SPEEDS_WITH_LANDINGS
    speeds = np.linspace(term.low, term.high, count)
    turns = simulate_steady_turns(subject.law, "one_mass", subject.rigid, speeds)
    levels = Acoustics(RadiationParameters.from_rig(subject.rig)).levels(turns)
    power = float(np.mean(10.0 ** (0.1 * (levels - levels.max()))))
    return float(levels.max() + 10.0 * np.log10(power))


# Quantities that depend on s, s', s'' at one cam angle: torque and contour.

#: Function that returns b candidate values ``(b, ...)``, the branches, of a quantity at cam angles.
#: The value of the quantity is the greatest of them.
Branches = Callable[[Motion], FloatArray]
#: Smallest number of samples of each polynomial piece of a law in the search for the maxima of a
#: quantity.
SAMPLES = 65
#: Number of samples of a turn in the search for the maxima of a quantity, divided among the
#: polynomial pieces of the law.
SAMPLES_PER_TURN = 4096
#: In a search for the maximum over a turn, the maximum of a piece of the law is computed to
#: rounding and returned only if it is below the largest one by at most this relative distance.
MAXIMUM_RTOL = 0.02


def pressure_angle(subject: Subject, *_: object) -> float:
    """Compute the largest magnitude of the pressure angle (rad) on any disc of the cam."""
    scans = _scans(subject)
    return max(scan.greatest(lambda touch: np.abs(touch.pressure)).value for scan in scans)


def least_radius(subject: Subject, *_: object) -> float:
    """Compute the smallest convex radius of curvature (m) on any disc of the cam.

    It is not positive if a contour is undercut, and infinite if no part is convex.
    """
    return min(float(sharpest_convex(scan).value) for scan in _scans(subject))


def _scans(subject: Subject) -> list[Scan]:
    """Return the contact of the follower with each disc of the cam, over the turn."""
    return [Scan(subject.law, plate.element) for plate in discs(subject.cam.follower, subject.law)]


def torque(subject: Subject, term: Term, _: Sense) -> float:
    """Compute the largest magnitude of the shaft torque (N·m) over a range of speeds.

    The follower is one rigid mass that stays on the cam. ``subject`` is the law on a rig, and
    ``term`` contains the range of speeds.
    """
    return max(value for value, _ in maxima(subject.law, torques(subject.rigid, term)))


def torques(p: FollowerParameters, term: Term) -> Branches:
    """Return a function that computes candidates of the largest shaft torque (N·m).

    At a cam angle they are ±(k s + c Ω s' + m Ω² s'' + F₀) s' of one rigid mass (eq. 8 of the
    paper) at both ends of the term's range of speeds Ω, and at the speed between them at which the
    torque is extreme. The largest of them is the largest magnitude over the range.
    """
    low, high = term.low, term.high

    def at(motion: Motion, speed: FloatArray) -> FloatArray:
        """Return the shaft torque (N·m) at cam speeds (rad/s), one per angle."""
        force = p.spring_stiffness * motion.s + p.preload
        force = force + (p.damping * motion.slope + p.mass * speed * motion.curvature) * speed
        return np.asarray(force * motion.slope)

    def branches(motion: Motion) -> FloatArray:
        speeds = dict.fromkeys((low, high))
        results = [at(motion, np.full(motion.s.shape, speed)) for speed in speeds]
        if low < high:
            with np.errstate(divide="ignore", invalid="ignore"):
                extreme = -0.5 * p.damping * motion.slope / (p.mass * motion.curvature)
            extreme = np.where(np.isnan(extreme), low, extreme)
            results.append(at(motion, np.clip(extreme, low, high)))
        return np.concatenate([results, np.negative(results)])

    return branches


def maxima(law: Law, branches: Branches) -> list[tuple[float, float]]:
    """Return the maximum of a quantity in each polynomial piece of a law.

    Each maximum is returned with its cam angle (rad). ``branches`` returns the candidate values of
    the quantity, of which the greatest counts. Only pieces whose maximum is within `MAXIMUM_RTOL`
    of that of the turn are in the list. If a value is not finite, the list contains only (∞, 0).
    """
    count = max(SAMPLES, min(512, SAMPLES_PER_TURN // law.spans.size))
    u = np.linspace(0.0, 1.0, count)
    values = branches(Motion.on_pieces(law, u)).max(axis=0)
    if not np.isfinite(values).all():
        return [(np.inf, 0.0)]
    best = values.max(axis=0)
    selected = best >= best.max() - MAXIMUM_RTOL * abs(best.max())
    result = []
    for piece in np.flatnonzero(selected).tolist():

        def curve(position: FloatArray, piece: int = piece) -> FloatArray:
            return np.asarray(branches(Motion.on_piece(law, piece, position)).max(axis=0))

        position, value = zoom(curve, float(u[values[:, piece].argmax()]), float(u[1]))
        result.append((value, float(law.breaks[piece] + position * law.spans[piece])))
    return result
