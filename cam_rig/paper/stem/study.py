"""Jump speed, residual vibration and level over the number of masses of the stem, and of a bar.

The two-mass follower (eq. 14-19 of the paper) has half of the stem's mass at either end. Here the
stem is cut into n elements, each with half of its mass at either end, a spring n k₁ and a damper
n c₁: n = 1 is the two-mass follower itself, and n → ∞ a bar, in closed form. Mass, static
stiffness and preload are the same for all n. In contact the foot of the stem is on the cam.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.linalg import eigh_tridiagonal
from scipy.optimize import brentq, minimize_scalar

from cam_rig.acoustics import RadiationParameters, level_db
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.vibration import low_dwell
from cam_rig.laws import Law
from cam_rig.laws.cam import CamSet
from cam_rig.schema import RigConfig
from cam_rig.show.result import Column, Records, Result
from cam_rig.units import RPM, TURN, ComplexArray, FloatArray

# A stem of n elements between roller and return spring, and the uniform bar it tends to.

#: Elements of a bar.
BAR = math.inf


@dataclass(frozen=True)
class Stem:
    """A stem with the most mass that the split allows, in ``elements`` parts; `BAR` for a bar."""

    follower: TwoMassParameters
    elements: float

    @property
    def mass(self) -> float:
        """Of the stem, kg."""
        return 2.0 * min(self.follower.roller_mass, self.follower.end_mass)

    @property
    def foot_mass(self) -> float:
        """What is at the roller besides the stem, kg."""
        return self.follower.roller_mass - 0.5 * self.mass

    @property
    def head_mass(self) -> float:
        """What is at the return spring besides the stem, kg."""
        return self.follower.end_mass - 0.5 * self.mass

    @property
    def on_cam(self) -> float:
        """What the lift's acceleration meets without any elasticity between, kg."""
        return self.foot_mass + 0.5 * self.mass / self.elements

    def transfer(self, rates: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """What a lift e^{pt}, p in 1/s and not 0, makes of contact force (N/m) and head (1)."""
        f, p = self.follower, np.asarray(rates)
        head = self.head_mass * p**2 + f.damping * p + f.spring_stiffness
        elastic = f.stem_stiffness + f.stem_damping * p
        if math.isinf(self.elements):
            phase = p * np.sqrt(self.mass / elastic)
            wave, slope = elastic * phase, np.tanh(phase)
            sides = wave + head * slope
            force = wave * (head + wave * slope) / sides
            shown = wave / sides * 2.0 * np.exp(-phase) / (1.0 + np.exp(-2.0 * phase))
            return self.foot_mass * p**2 + force, shown
        elastic, inertia = self.elements * elastic, self.mass / self.elements * p**2
        load, shown = head + 0.5 * inertia, np.ones_like(p)
        for _ in range(int(self.elements)):
            passed = elastic / (elastic + load)
            load, shown = inertia + passed * load, shown * passed
        return load - 0.5 * inertia + self.foot_mass * p**2, shown

    def natural_frequencies(self, count: int) -> FloatArray:
        """The lowest, rad/s, undamped and in contact: foot held, ``(count,)`` or all there are."""
        f = self.follower
        if math.isinf(self.elements):
            return self._of_bar(count)
        n = int(self.elements)
        masses = np.full(n, self.mass / n)
        masses[-1] = 0.5 * self.mass / n + self.head_mass
        stiffness = np.full(n, 2.0 * n * f.stem_stiffness)
        stiffness[-1] = n * f.stem_stiffness + f.spring_stiffness
        beside = -n * f.stem_stiffness / np.sqrt(masses[1:] * masses[:-1])
        squares = eigh_tridiagonal(stiffness / masses, beside, eigvals_only=True)
        return np.asarray(np.sqrt(squares[:count]))

    def _of_bar(self, count: int) -> FloatArray:
        """Roots γ of k₁ γ cos γ + (k₂ − m ω²) sin γ = 0, with ω = γ √(k₁/stem mass)."""
        f = self.follower
        square = f.stem_stiffness / self.mass

        def closes(phase: float) -> float:
            pull = f.spring_stiffness - self.head_mass * square * phase**2
            return f.stem_stiffness * phase * math.cos(phase) + pull * math.sin(phase)

        roots = [brentq(closes, (i + 1e-9) * math.pi, (i + 1.0) * math.pi) for i in range(count)]
        return np.array(roots) * math.sqrt(square)


# The steady turn of a stem of any number of elements as a Fourier series, exact in each harmonic.

#: Harmonics up to this many times the stem's own frequency are taken, as a power of two, ...
BEYOND = 8.0
#: ... and at least so many; the law is sampled this much finer, so that little of it folds back.
MIN_HARMONICS, FINER = 2048, 4


@dataclass(frozen=True, eq=False)
class StemTurn:
    """One steady turn at ``speed`` (rad/s): ``(n,)`` angle (rad), force (N) and head (m).

    ``head`` is the displacement at the return spring about the static share of the lift;
    ``harmonics`` those of the force but the mean, ``(k,)`` in N.
    """

    speed: float
    angle: FloatArray
    force: FloatArray
    head: FloatArray
    harmonics: ComplexArray

    def power(self, corner_rate: float) -> float:
        """⟨(ω_c (F − q))²⟩ in (N/s)²: what the structure of corner ω_c (rad/s) passes on."""
        rate = 1j * self.speed * np.arange(1, self.harmonics.size + 1)
        passed = corner_rate * rate / (rate + corner_rate) * self.harmonics
        return float(2.0 * np.sum(np.abs(passed) ** 2))


def stem_turn(law: Law, stem: Stem, speed: float) -> StemTurn:
    """The turn at ``speed`` (rad/s)."""
    own = math.sqrt(stem.follower.stem_stiffness / stem.follower.end_mass)
    wanted = max(float(MIN_HARMONICS), BEYOND * own / speed)
    count = 2 ** math.ceil(math.log2(wanted))
    lift = _harmonics(law, count)
    f, rates = stem.follower, 1j * speed * np.arange(1, count + 1)
    force, head = stem.transfer(rates)
    held = f.share * f.spring_stiffness * lift[0].real + f.share * f.preload
    forces = np.concatenate([[held], force * lift[1:]])
    rest = forces - stem.on_cam * np.concatenate([[0.0], rates**2]) * lift
    heads = np.concatenate([[0.0], (head - f.share) * lift[1:]])
    size = 2 * count
    angle = np.arange(size) * (TURN / size)
    # The series of the acceleration itself would end too early at its corners.
    inertia = stem.on_cam * speed**2 * law(angle, 2)
    whole, moved = (np.fft.irfft(series, size) * size for series in (rest, heads))
    return StemTurn(speed, angle, inertia + whole, moved, forces[1:])


@lru_cache(maxsize=64)
def _harmonics(law: Law, count: int) -> ComplexArray:
    """Of the lift, from the mean to the last, ``(count + 1,)`` in m."""
    size = 2 * count * FINER
    angle = np.arange(size, dtype=np.float64) * (TURN / size)
    series = np.fft.rfft(law(angle)) / size
    return np.asarray(series[: count + 1], dtype=np.complex128)


# What they change.

#: Elements of the stem; one is the two-mass follower.
ELEMENTS = (1.0, 2.0, 3.0, 5.0, 9.0, BAR)
#: The jump is sought from this many of the stem's resonances below the rigid follower's on, in
#: this many steps for each; above it no further than this ratio.
RESONANCES, STEPS, HIGHEST = 8.0, 8.0, 1.5
#: A jump speed is found to this, relative.
FOUND = 1e-7
#: Two masses are enough where the least contact force is that of a bar to this part of the
#: preload; speeds (rpm) at which they are compared.
TENTH, SLOWEST, STEP = 0.1, 100.0, 5.0
#: Speed at which the report's stems are compared, rpm, and the cam that is shown over the masses.
STEM_RPM, SHOWN_CAM = 300.0, "poly345"


@dataclass(frozen=True)
class StemRow:
    """A stem of ``elements``: its first natural frequency (Hz), and by cam the rest.

    ``jump`` is the jump speed in steady state (rpm); ``vibration`` (m) peak to peak of the head
    in the low dwell, about the static share of the lift, and ``level`` (dB) are at one speed.
    """

    elements: float
    frequency: float
    jump: dict[str, float]
    vibration: dict[str, float]
    level: dict[str, float]


@dataclass(frozen=True)
class StemStudy:
    """The rows of one stem, stiffness in N/m, with vibration and level at ``rpm``.

    ``stem_mass`` in kg; ``off_from`` is by cam the lowest speed (rpm) at which two masses are not
    enough, None where they are up to the jump, and ``level_off`` by how much (dB) their level is
    off at most up to there. ``matched`` is a bar with the first natural
    frequency of the two masses, its stiffness ``matched_stiffness``.
    """

    stiffness: float
    stem_mass: float
    rpm: float
    rows: list[StemRow]
    off_from: dict[str, float | None]
    level_off: dict[str, float]
    matched: StemRow
    matched_stiffness: float

    @property
    def two_masses(self) -> StemRow:
        """The two-mass follower."""
        return self.rows[0]

    @property
    def bar(self) -> StemRow:
        """The limit."""
        return self.rows[-1]

    @property
    def off(self) -> tuple[str, float] | None:
        """The cam on which two masses stop being enough first, and from which speed (rpm) on."""
        found = {cam: rpm for cam, rpm in self.off_from.items() if rpm is not None}
        return min(found.items(), key=lambda pair: pair[1]) if found else None

    def jump_error(self, bar: StemRow) -> tuple[str, float]:
        """The cam whose jump speed two masses miss by most, and by how much of a bar's."""
        errors = {cam: self.two_masses.jump[cam] / rpm - 1.0 for cam, rpm in bar.jump.items()}
        return max(errors.items(), key=lambda pair: abs(pair[1]))

    @property
    def level_error(self) -> float:
        """By how much the level of two masses is off at most, dB, of all cams."""
        return max(self.level_off.values())


class OnStem(NamedTuple):
    """A cam on the stem of a study, in so many masses."""

    of: StemStudy
    row: StemRow
    cam: str


@dataclass(frozen=True, eq=False, repr=False)
class StemResult(Result):
    """Cams on stems of several stiffnesses, each in more and more masses."""

    schema = "cam_rig.stem.1"
    plot_function = "cam_rig.paper.stem.figures:figure"
    columns: ClassVar = {
        "masses": (
            Column("stiffness", "N/m", ".3g", of="of.stiffness"),
            Column("cam"),
            Column(
                "masses",
                of=lambda one: one.row.elements + 1.0,
                cell=lambda one: f"{one.row.elements + 1.0:g}".replace("inf", "bar"),
            ),
            Column("frequency", "Hz", ".1f", "first natural frequency", "row.frequency"),
            Column(
                "off", "%", "+.2f", of=lambda one: one.row.frequency / one.of.bar.frequency - 1.0
            ),
            Column("jump", "rpm", ".1f", "jump speed", lambda one: one.row.jump[one.cam]),
            Column(
                "vibration", "µm", ".3g", "residual vibration", lambda o: o.row.vibration[o.cam]
            ),
            Column("level", "dB", ".2f", of=lambda one: one.row.level[one.cam]),
        ),
        "cams": (
            Column("stiffness", "N/m", ".3g", of="of.stiffness"),
            Column("law", of="cam"),
            Column("two_masses", "rpm", ".1f", of=lambda one: one.of.two_masses.jump[one.cam]),
            Column("bar", "rpm", ".1f", of=lambda one: one.of.bar.jump[one.cam]),
            Column(
                "off",
                "%",
                "+.2f",
                "two masses off",
                lambda o: o.of.two_masses.jump[o.cam] / o.of.bar.jump[o.cam] - 1.0,
            ),
            Column(
                "force_off_from", "rpm", ".0f", of=lambda o: o.of.off_from[o.cam], missing="never"
            ),
            Column("level_off", "dB", ".2f", of=lambda one: one.of.level_off[one.cam]),
            Column("matched", "rpm", ".1f", "softer bar", lambda o: o.of.matched.jump[o.cam]),
            Column("matched_stiffness", "N/m", ".3g", "its stiffness", "of.matched_stiffness"),
        ),
    }

    cam_set: CamSet
    studies: tuple[StemStudy, ...]

    def tables(self) -> list[Records]:
        """``masses``, of which people read one cam, and jump speeds of all on either stem."""
        first = self.studies[0]
        masses = [OnStem(s, row, cam) for s in self.studies for row in s.rows for cam in row.jump]
        return [
            self.table(
                "masses",
                f"A stem of {{stiffness:.3g}} N/m in more and more masses, {SHOWN_CAM}",
                masses,
                f"Steady state, vibration and level at {first.rpm:g} rpm. {first.stem_mass:.3g} kg "
                "of the follower are the stem's (assumed: the most that the mass split allows); "
                "total mass, stiffness and preload stay.",
                group_by="stiffness",
                row_filter=lambda one: one.cam == SHOWN_CAM,
            ),
            self.table(
                "cams",
                "Two masses and a bar: jump speeds on a stem of {stiffness:.3g} N/m",
                (one for one in masses if one.row is one.of.bar),
                "Force off from: the least contact force misses the bar's by a tenth of the "
                "preload. Level off: at most, from 100 rpm to the jump.",
                "The softer bar has the first natural frequency of the two masses.",
                group_by="stiffness",
            ),
        ]


def study_stems(cam_set: CamSet, stiffnesses: Iterable[float], rpm: float) -> StemResult:
    """Every cam on stems of these stiffnesses (N/m), all else as in the rig."""
    return StemResult(cam_set, tuple(study_stem(cam_set, one, rpm) for one in stiffnesses))


def study_stem(cam_set: CamSet, stiffness: float, rpm: float) -> StemStudy:
    """Every cam on a stem of ``stiffness`` (N/m), all else as in the rig."""
    rig = cam_set.rig.with_follower(stem_stiffness=stiffness)
    follower = TwoMassParameters.from_rig(rig)
    rows = [_row(cam_set, rig, elements, rpm) for elements in ELEMENTS]
    radiation = RadiationParameters.from_rig(rig)
    off_from: dict[str, float | None] = {}
    level_off = {}
    for cam, law in cam_set.laws.items():
        jump = min(rows[0].jump[cam], rows[-1].jump[cam])
        off_from[cam], level_off[cam] = _off(law, follower, radiation, jump)
    same = matched_stiffness(follower)
    matched = _row(cam_set, rig.with_follower(stem_stiffness=same), BAR, rpm)
    mass = Stem(follower, 1.0).mass
    return StemStudy(stiffness, mass, rpm, rows, off_from, level_off, matched, same)


def _row(cam_set: CamSet, rig: RigConfig, elements: float, rpm: float) -> StemRow:
    stem = Stem(TwoMassParameters.from_rig(rig), elements)
    radiation = RadiationParameters.from_rig(rig)
    turns = {cam: stem_turn(law, stem, rpm * RPM) for cam, law in cam_set.laws.items()}
    return StemRow(
        elements,
        float(stem.natural_frequencies(1)[0]) / (2.0 * math.pi),
        {cam: stem_jump(law, stem, rig) / RPM for cam, law in cam_set.laws.items()},
        {cam: vibration(cam_set.laws[cam], turn) for cam, turn in turns.items()},
        {cam: level(turn, radiation) for cam, turn in turns.items()},
    )


def matched_stiffness(follower: TwoMassParameters) -> float:
    """Stiffness (N/m) of the bar whose first natural frequency is that of the two masses."""
    wanted = float(Stem(follower, 1.0).natural_frequencies(1)[0])

    def away(stiffness: float) -> float:
        bar = Stem(replace(follower, stem_stiffness=stiffness), BAR)
        return float(bar.natural_frequencies(1)[0]) - wanted

    most = follower.stem_stiffness
    return float(brentq(away, 0.1 * most, 2.0 * most, rtol=1e-12))


def vibration(law: Law, turn: StemTurn) -> float:
    """Residual vibration (m), peak to peak of the head in the low dwell."""
    return float(np.ptp(turn.head[low_dwell(law).holds(turn.angle)]))


def level(turn: StemTurn, radiation: RadiationParameters) -> float:
    """Sound pressure level (dB) of contact and background."""
    contact = radiation.gain**2 * turn.power(radiation.corner_rate)
    return float(level_db(math.sqrt(radiation.background_power(turn.speed) + contact)))


def stem_jump(law: Law, stem: Stem, rig: RigConfig) -> float:
    """The lowest speed (rad/s) at which the least contact force of the steady turn is zero."""

    def least(speed: float) -> float:
        return float(stem_turn(law, stem, speed).force.min())

    rigid = rigid_jump_speed(law, FollowerParameters.from_rig(rig))
    apart = rigid / float(stem.natural_frequencies(1)[0])  # two resonances, relative
    speeds, values = [rigid * max(0.3, 1.0 - RESONANCES * apart)], list[float]()
    while speeds[-1] < HIGHEST * rigid:
        values.append(least(speeds[-1]))
        left, mid, right = values[-3:] if len(values) > 2 else (0.0,) * 3
        # a minimum that could hide a sign change beside it
        if 0.0 < mid <= min(left, right) and mid < left - 2.0 * mid + right:
            near = minimize_scalar(least, bounds=(speeds[-3], speeds[-1]), method="bounded")
            if near.fun <= 0.0:
                return float(brentq(least, speeds[-3], near.x, rtol=FOUND))
        if values[-1] <= 0.0:
            break
        speeds.append(speeds[-1] * (1.0 + apart / STEPS))
    if len(values) < 2 or values[-1] > 0.0:
        return 0.0 if values[-1] <= 0.0 else math.inf
    return float(brentq(least, speeds[-2], speeds[-1], rtol=FOUND))


def _off(
    law: Law, follower: TwoMassParameters, radiation: RadiationParameters, jump: float
) -> tuple[float | None, float]:
    """The lowest speed (rpm) at which two masses miss the bar's least force, and its level (dB)."""
    first, most = None, 0.0
    for rpm in np.arange(SLOWEST, jump, STEP).tolist():
        two, bar = (stem_turn(law, Stem(follower, n), rpm * RPM) for n in (1.0, BAR))
        most = max(most, abs(level(two, radiation) - level(bar, radiation)))
        if first is None and abs(two.force.min() - bar.force.min()) > TENTH * follower.preload:
            first = rpm
    return first, most
