"""Stem of n elements, and a bar as their limit, compared with two masses.

The two-mass follower (eq. 14 to 19 of the paper) has half of the stem's mass at each end. Here the
stem is divided into n elements, each with half of its mass at each end, a spring n k₁ and a damper
n c₁. n = 1 is the two-mass follower, and n → ∞ a bar in closed form. Mass, static stiffness and
preload are the same for all n. In contact the foot of the stem is on the cam.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.linalg import eigh_tridiagonal
from scipy.optimize import brentq, minimize_scalar

import cam_rig
from cam_rig.acoustics import RadiationParameters, level_db
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.vibration import low_dwell
from cam_rig.show.figure import CAM_SPEED, empty, logarithmic, series, series_marker, styled
from cam_rig.units import RPM, TURN, ComplexArray, FloatArray
from examples.paper.common import CAMS, RIG, STIFF_RIG, Table, load_laws, parser, publish

#: Number of elements of a bar, and of the compared stems.
BAR = math.inf
ELEMENTS = (1.0, 2.0, 3.0, 5.0, 9.0, BAR)
#: Speed (rpm) for vibration and level.
SPEED_RPM = 300.0
#: Cam whose results are listed for all numbers of elements.
SHOWN_CAM = "poly345"
#: Lowest speed (rpm) at which two masses are compared with the bar.
SLOWEST_RPM = 100.0
#: Step (rpm) of these speeds, up to the jump speed.
STEP_RPM = 5.0
#: Two masses are sufficient if their smallest force differs from that of the bar by at most this,
#: relative to the preload.
SUFFICIENT = 0.1
#: Highest frequency of the series, as a multiple of the frequency of the stem.
HARMONICS_PER_STEM = 8.0
#: Smallest number of harmonics of the series.
MIN_HARMONICS = 2048
#: Samples of the law per sample of the series, against aliasing.
OVERSAMPLING = 4
#: Number of resonances below the jump speed of a rigid follower at which the search starts.
RESONANCES = 8.0
#: Number of speeds per resonance. Three of them locate a minimum of the smallest force.
STEPS = 8.0
#: Highest speed of the search, relative to the jump speed of a rigid follower.
HIGHEST = 1.5


@dataclass(frozen=True)
class Stem:
    """Stem of the largest mass that the two masses allow, in `elements` parts.

    `BAR` elements are a bar.
    """

    follower: TwoMassParameters
    elements: float

    @property
    def mass(self) -> float:
        """Mass (kg) of the stem."""
        return 2.0 * min(self.follower.roller_mass, self.follower.end_mass)

    @property
    def foot_mass(self) -> float:
        """Mass (kg) at the roller in addition to the stem."""
        return self.follower.roller_mass - 0.5 * self.mass

    @property
    def head_mass(self) -> float:
        """Mass (kg) at the return spring in addition to the stem."""
        return self.follower.end_mass - 0.5 * self.mass

    def transfer(self, rates: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return contact force (N/m) and motion of the head (1) per lift e^{pt}.

        The rates p ≠ 0 are in 1/s.
        """
        f, p = self.follower, np.asarray(rates)
        head = self.head_mass * p**2 + f.damping * p + f.spring_stiffness
        elastic = f.stem_stiffness + f.stem_damping * p
        if math.isinf(self.elements):
            phase = p * np.sqrt(self.mass / elastic)
            wave, slope = elastic * phase, np.tanh(phase)
            sides = wave + head * slope
            force = wave * (head + wave * slope) / sides
            moved = wave / sides * 2.0 * np.exp(-phase) / (1.0 + np.exp(-2.0 * phase))
            return self.foot_mass * p**2 + force, moved
        elastic, inertia = self.elements * elastic, self.mass / self.elements * p**2
        load, moved = head + 0.5 * inertia, np.ones_like(p)
        for _ in range(int(self.elements)):
            passed = elastic / (elastic + load)
            load, moved = inertia + passed * load, moved * passed
        return load - 0.5 * inertia + self.foot_mass * p**2, moved

    def frequencies(self, count: int) -> FloatArray:
        """Return the lowest undamped natural frequencies (rad/s) with a fixed foot.

        There are at most `count`.
        """
        f = self.follower
        if math.isinf(self.elements):  # k₁ γ cos γ + (k₂ − m ω²) sin γ = 0, ω = γ √(k₁/mass)
            square = f.stem_stiffness / self.mass

            def residual(phase: float) -> float:
                pull = f.spring_stiffness - self.head_mass * square * phase**2
                return f.stem_stiffness * phase * math.cos(phase) + pull * math.sin(phase)

            roots = [
                brentq(residual, (i + 1e-9) * math.pi, (i + 1) * math.pi) for i in range(count)
            ]
            return np.array(roots) * math.sqrt(square)
        n = int(self.elements)
        masses = np.full(n, self.mass / n)
        masses[-1] = 0.5 * self.mass / n + self.head_mass
        stiffness = np.full(n, 2.0 * n * f.stem_stiffness)
        stiffness[-1] = n * f.stem_stiffness + f.spring_stiffness
        coupling = -n * f.stem_stiffness / np.sqrt(masses[1:] * masses[:-1])
        squares = eigh_tridiagonal(stiffness / masses, coupling, eigvals_only=True)
        return np.asarray(np.sqrt(squares[:count]))


class Turn(NamedTuple):
    """Steady turn: cam angle (rad), contact force (N) and head (m), `(n,)` each.

    `head` is relative to its static part of the lift. `harmonics` (N) are those of the force
    without the mean, and `rates` are i n ω in 1/s.
    """

    angle: FloatArray
    force: FloatArray
    head: FloatArray
    harmonics: ComplexArray
    rates: ComplexArray


def stem_turn(law: cam_rig.Law, stem: Stem, speed: float) -> Turn:
    """Return the steady turn at `speed` (rad/s), exact for each harmonic of the lift."""
    f = stem.follower
    own = math.sqrt(f.stem_stiffness / f.end_mass)
    count = 2 ** math.ceil(math.log2(max(float(MIN_HARMONICS), HARMONICS_PER_STEM * own / speed)))
    lift, rates = _harmonics(law, count), 1j * speed * np.arange(1, count + 1)
    force, head = stem.transfer(rates)
    static = f.share * f.spring_stiffness * lift[0].real + f.share * f.preload
    forces = np.concatenate([[static], force * lift[1:]])
    # The force of the mass on the cam is computed from s'', because its series converges slowly.
    on_cam = stem.foot_mass + 0.5 * stem.mass / stem.elements
    free_force = forces - on_cam * np.concatenate([[0.0], rates**2]) * lift
    heads = np.concatenate([[0.0], (head - f.share) * lift[1:]])
    angle = np.arange(2.0 * count) * (TURN / (2 * count))
    total, moved = (np.fft.irfft(part, 2 * count) * (2 * count) for part in (free_force, heads))
    return Turn(angle, on_cam * speed**2 * law(angle, 2) + total, moved, forces[1:], rates)


@lru_cache(maxsize=64)
def _harmonics(law: cam_rig.Law, count: int) -> ComplexArray:
    """Return the harmonics (m) of the lift, from the mean to the last, `(count + 1,)`."""
    size = 2 * count * OVERSAMPLING
    return np.asarray(np.fft.rfft(law(np.arange(float(size)) * (TURN / size)))[: count + 1] / size)


def level(turn: Turn, radiation: RadiationParameters) -> float:
    """Return the sound pressure level (dB) of contact force and background."""
    corner, speed = radiation.corner_rate, float(turn.rates[0].imag)
    passed = corner * turn.rates / (turn.rates + corner) * turn.harmonics
    power = radiation.gain**2 * float(2.0 * np.sum(np.abs(passed) ** 2))
    return float(level_db(math.sqrt(radiation.background_power(speed) + power)))


def stem_jump(law: cam_rig.Law, stem: Stem, rig: cam_rig.Rig) -> float:
    """Return the lowest speed (rpm) with a smallest force of zero in the steady turn."""

    def least(speed: float) -> float:
        return float(stem_turn(law, stem, speed).force.min())

    rigid = cam_rig.jump_speed(law, rig.replace(roller_share=None, stem_damping=None)).speed
    spacing = rigid / float(stem.frequencies(1)[0])  # relative distance of two resonances
    speeds, values = [rigid * max(0.3, 1.0 - RESONANCES * spacing)], list[float]()
    while speeds[-1] < HIGHEST * rigid:
        values.append(least(speeds[-1]))
        left, middle, right = values[-3:] if len(values) > 2 else (0.0,) * 3
        # A minimum that is low enough for two sign changes between its neighbours.
        if 0.0 < middle <= min(left, right) and middle < left - 2.0 * middle + right:
            near = minimize_scalar(least, bounds=(speeds[-3], speeds[-1]), method="bounded")
            if near.fun <= 0.0:
                return float(brentq(least, speeds[-3], near.x, rtol=1e-7)) / RPM
        if values[-1] <= 0.0:
            return float(brentq(least, speeds[-2], speeds[-1], rtol=1e-7)) / RPM
        speeds.append(speeds[-1] * (1.0 + spacing / STEPS))
    raise ValueError(f"{law.name}: contact is kept up to {HIGHEST:g} times the rigid jump speed")


def matched_stiffness(follower: TwoMassParameters) -> float:
    """Return the stiffness (N/m) of a bar with the first frequency of the two masses."""
    wanted, most = Stem(follower, 1.0).frequencies(1)[0], follower.stem_stiffness

    def difference(stiffness: float) -> float:
        bar = Stem(replace(follower, stem_stiffness=stiffness), BAR)
        return float(bar.frequencies(1)[0] - wanted)

    return float(brentq(difference, 0.1 * most, 2.0 * most, rtol=1e-12))


class StemTables(NamedTuple):
    """Results for a stem of `stiffness` (N/m): one cam for all elements, and all cams.

    `matched` is the stiffness (N/m) of the bar with the first natural frequency of the two masses.
    """

    stiffness: float
    over_elements: Table
    over_cams: Table
    matched: float


def study_stem(rig: cam_rig.Rig, laws: Mapping[str, cam_rig.Law]) -> StemTables:
    """Compare stems with increasing numbers of elements, and two masses with a bar."""
    follower, radiation = TwoMassParameters.from_rig(rig), RadiationParameters.from_rig(rig)
    two, bar, soft = Stem(follower, 1.0), Stem(follower, BAR), matched_stiffness(follower)
    softer, first = Stem(replace(follower, stem_stiffness=soft), BAR), float(bar.frequencies(1)[0])
    by_elements, by_cam, law = [], [], laws[SHOWN_CAM]
    title = cam_rig.load_cam(SHOWN_CAM).title
    for elements in ELEMENTS:
        stem = Stem(follower, elements)
        turn, frequency = stem_turn(law, stem, SPEED_RPM * RPM), float(stem.frequencies(1)[0])
        vibration = float(np.ptp(turn.head[low_dwell(law).contains(turn.angle)]))
        masses = f"{elements + 1.0:g}".replace("inf", "bar")
        numbers = frequency / TURN, 100.0 * (frequency / first - 1.0), stem_jump(law, stem, rig)
        by_elements.append((masses, *numbers, 1e6 * vibration, level(turn, radiation)))
    for cam, law in laws.items():
        jumps = [stem_jump(law, stem, rig) for stem in (two, bar, softer)]
        insufficient, level_error = "never", 0.0
        for rpm in np.arange(SLOWEST_RPM, min(jumps[:2]), STEP_RPM).tolist():
            two_masses, other = (stem_turn(law, stem, rpm * RPM) for stem in (two, bar))
            level_error = max(
                level_error, abs(level(two_masses, radiation) - level(other, radiation))
            )
            apart = abs(two_masses.force.min() - other.force.min())
            if insufficient == "never" and apart > SUFFICIENT * follower.preload:
                insufficient = f"{rpm:.0f}"
        off = 100.0 * (jumps[0] / jumps[1] - 1.0)
        row = (cam_rig.load_cam(cam).title, *jumps[:2], off, insufficient, level_error, jumps[2])
        by_cam.append((*row, soft))
    return StemTables(
        follower.stem_stiffness,
        Table(
            f"A stem of {follower.stem_stiffness:.3g} N/m in more and more masses, {title}",
            "masses | first natural frequency [Hz] :.1f | off [%] :+.2f | "
            "jump speed [rpm] :.1f | residual vibration [µm] :.3g | level [dB] :.2f",
            by_elements,
            f"Steady state, vibration and level at {SPEED_RPM:g} rpm. {two.mass:.3g} kg of the "
            "follower are the stem's (assumed: the most that the mass split allows); total "
            "mass, stiffness and preload stay.",
        ),
        Table(
            f"Two masses and a bar: jump speeds on a stem of {follower.stem_stiffness:.3g} N/m",
            "law | two masses [rpm] :.1f | bar [rpm] :.1f | two masses off [%] :+.2f | "
            "force off from [rpm] | level off [dB] :.2f | softer bar [rpm] :.1f | "
            "its stiffness [N/m] :.3g",
            by_cam,
            "Force off from: the least contact force misses the bar's by a tenth of the "
            "preload. Level off: at most, from 100 rpm to the jump.\n"
            "The softer bar has the first natural frequency of the two masses.",
        ),
        soft,
    )


def study(cams: Sequence[str] = CAMS) -> list[StemTables]:
    """Compare stems with the stiffness from table 2 and with that of table 1."""
    rig, printed = cam_rig.load_rig(RIG), cam_rig.load_rig(STIFF_RIG).follower.stem_stiffness
    assert printed is not None
    rigs = rig, rig.with_follower(stem_stiffness=printed.si)
    return [study_stem(rig, load_laws(cams)) for rig in rigs]


@styled
def figure() -> Figure:
    """Draw errors of natural frequencies by elements, and the smallest force by speed."""
    law, follower = (
        load_laws([SHOWN_CAM])[SHOWN_CAM],
        TwoMassParameters.from_rig(cam_rig.load_rig(RIG)),
    )
    counts, speeds = np.array([1, 2, 3, 5, 9, 17, 33]), np.arange(150.0, 440.0, 2.0)
    limits = Stem(follower, BAR).frequencies(3)
    out = empty(3.3)
    left, right = out.subplots(1, 2)
    for mode in range(3):
        n = counts[counts > mode]
        result = [Stem(follower, float(elements)).frequencies(mode + 1)[mode] for elements in n]
        error = 100.0 * np.abs(np.array(result) / limits[mode] - 1.0)
        left.loglog(n, error, label=f"frequency {mode + 1}", **series_marker(mode))
    left.loglog(counts, 10.0 / counts**2.0, color="0.4", lw=0.8, ls=":", label="∝ 1/n²")
    logarithmic(left.xaxis, left.yaxis)
    left.set(title="Error of the natural frequencies", xlabel="elements n", ylabel="error [%]")
    for i, (elements, name) in enumerate(
        {1.0: "two masses", 2.0: "three masses", BAR: "bar"}.items()
    ):
        stem = Stem(follower, elements)
        least = [stem_turn(law, stem, speed * RPM).force.min() for speed in speeds]
        right.plot(speeds, least, label=name, **series(i))
    right.axhline(0.0, color="0.3", lw=0.9)
    title = f"Least contact force,\n{cam_rig.load_cam(SHOWN_CAM).title}"
    right.set(title=title, xlabel=CAM_SPEED, ylabel="force [N]", ylim=(-15.0, None))
    for axes in (left, right):
        axes.legend(frameon=False)
    out.suptitle(f"Stem of {follower.stem_stiffness / 1e6:.3g} MN/m, steady state")
    return out


class Errors(NamedTuple):
    """Largest errors of the two-mass model of a stem.

    `jump` is the cam and the relative error of its jump speed in %, and `level` the error (dB) of
    the level up to the jump speed. `insufficient` is the cam and the speed (rpm) from which two
    masses are not sufficient, or None if they are sufficient up to the jump speed.
    """

    jump: tuple[str, float]
    level: float
    insufficient: tuple[str, float] | None


def errors(result: StemTables) -> Errors:
    """Return the largest errors of the two-mass model of a stem."""
    rows = result.over_cams.frame.set_index("law")
    off, level_off = rows["two masses off [%]"], rows["level off [dB]"]
    speeds = rows["force off from [rpm]"].replace("never", "inf").astype(float)
    first = speeds.idxmin(), float(speeds.min())
    jump = off.abs().idxmax(), float(off[off.abs().idxmax()])
    return Errors(jump, float(level_off.max()), first if math.isfinite(first[1]) else None)


def matched_error(result: StemTables) -> float:
    """Return the largest error (%) of two masses compared with the softer bar."""
    rows = result.over_cams.frame
    return float((100.0 * (rows["two masses [rpm]"] / rows["softer bar [rpm]"] - 1.0)).abs().max())


def summary(result: StemTables) -> str:
    """Return the largest errors of the two-mass model of a stem as text."""
    (cam, off), level_off, _ = errors(result)
    return (
        f"stem of {result.stiffness:.3g} N/m: jump speed of two masses off by at most "
        f"{off:+.2f} % ({cam}), level by {level_off:.2f} dB"
    )


def main(argv: Sequence[str] | None = None) -> None:
    """Run the experiment, which needs about 15 s."""
    out = parser(__doc__).parse_args(argv).out
    result = study()
    tables = [
        table for stem_study in result for table in (stem_study.over_elements, stem_study.over_cams)
    ]
    publish(out, tables, {"stem": figure()}, map(summary, result))


if __name__ == "__main__":
    main()
