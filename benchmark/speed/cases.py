"""Cases of the comparison, and samples per second of cam_rig.

A case is a law, the parameters of a model, a speed and a duration.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmark.speed.models import (
    BenchModel,
    Case,
    OneMass,
    Oscillator,
    Twist,
    TwoMasses,
    output_times,
)
from cam_rig.dynamics import MODELS, FollowerParameters, Interval
from cam_rig.dynamics.interval import COLUMNS
from cam_rig.laws import Law, build_law
from cam_rig.laws.sampling import fit_curve
from cam_rig.laws.segments import trigonometric
from cam_rig.schema.load import config_root, load_cam
from cam_rig.show.tables import DataTable, Header, tabulate
from cam_rig.units import NS, TURN

#: Mass of the follower (kg), from Table 1 of the paper.
MASS = 1.3
#: Spring stiffness (N/m), from Table 1 of the paper.
SPRING = 4030.0
#: Stem stiffness (N/m), assumed.
STEM = 3.3e8
#: Damping (N·s/m), from Table 1 of the paper.
DAMPING = 8.642
#: Weight of the mass (N).
WEIGHT = 12.753
#: Stem stiffness (N/m) identified from the paper's jump speeds (its Table 2).
SOFT_STEM = 1.26e6
#: Share of the mass on the roller's side, identified from Table 2.
ROLLER_SHARE = 0.40
#: Preload (N) identified from Table 2.
PRELOAD = 30.6

#: Spring stiffness (N/m) of a ball that has no spring, because the model needs one. Its force is
#: 1e-9 of the weight.
NO_SPRING = 1e-6
#: Acceleration of gravity (m/s²), and weight (N) of a ball of 1 kg.
GRAVITY = 9.81
#: Speed (rpm) of the table on which the ball bounces. Its largest acceleration is 1.33 times that
#: of gravity.
BALL_RPM = 345.0

#: Height of the lowest bounce relative to the lift. A lower bounce is contact.
MIN_BOUNCE = 1e-12


def law_of(cam: str) -> Law:
    """Return the law of a shipped cam."""
    return build_law(load_cam(config_root() / "cams" / f"{cam}.yaml"))


def elastic_stem() -> Case:
    """Return a stiff oscillator with smooth excitation and little damping."""
    model, law = Oscillator(MASS, DAMPING, SPRING, STEM), law_of("poly345")
    return _case("elastic_stem", "residual vibration on the stem", law, model, 300, 20, 25)


def resonance() -> Case:
    """Return an undamped follower in resonance with the ninth harmonic of the cam.

    Its response increases without limit. The even harmonics of this cam are zero, because the fall
    is the rise half a turn later.
    """
    stiffness = MASS * (9.0 * rad_per_s(300)) ** 2
    model, law = Oscillator(MASS, 0.0, SPRING, stiffness - SPRING), law_of("poly345")
    return _case("resonance", "undamped resonance, ω_n = 9 ω", law, model, 300, 20, 25)


def torsional() -> Case:
    """Return an elastic camshaft. The equation is nonlinear in the twist."""
    model = Twist(0.02, 1e4, MASS, DAMPING, SPRING, WEIGHT)
    return _case("torsional", "torsional vibration", law_of("poly345"), model, 400, 4, 50)


def _two_mass(name: str, title: str, stem_stiffness: float, preload: float) -> Case:
    roller = ROLLER_SHARE * MASS
    model = TwoMasses(roller, MASS - roller, stem_stiffness, SPRING, DAMPING, DAMPING, preload)
    return _case(name, title, law_of("poly345"), model, 450, 2, 97)


def two_mass_soft() -> Case:
    """Return two masses that lift off, with the identified stem stiffness."""
    return _two_mass("two_mass_soft", "two masses, stem 1.26e6 N/m", SOFT_STEM, PRELOAD)


def two_mass_stem() -> Case:
    """Return two masses that lift off, with the stem stiffness of the paper.

    They land and bounce many times. The preload is the weight of the follower, because with the
    identified 30.6 N there is no lift-off.
    """
    return _two_mass("two_mass_stem", "two masses, stem 3.3e8 N/m", STEM, WEIGHT)


def one_mass_arc() -> Case:
    """Return a rigid follower that lifts off a cam of arcs and bounces."""
    bounce = MIN_BOUNCE * law_of("tm21").lift
    model = OneMass(MASS, DAMPING, SPRING, WEIGHT, 0.8, bounce)
    return _case(
        "one_mass_arc", "one mass, arc cam, restitution 0.8", law_of("tm21"), model, 400, 10, 50
    )


def ball_on_table() -> Case:
    """Return a ball that bounces on a table with a sinusoidal motion of 10 mm.

    It is the standard problem of impact dynamics: P. J. Holmes, "The dynamics of repeated impacts
    with a sinusoidally vibrating table", Journal of Sound and Vibration 84 (1982). The motion is
    irregular: 20 turns would enlarge a rounding error by 1e9.
    """
    motion = trigonometric(0.01, [-0.01], [0.0])
    breaks, ordinates = fit_curve(motion, 0.0, TURN, degree=12)
    table = Law("table", np.array(breaks), np.stack(ordinates, axis=1))
    ball = OneMass(1.0, 0.0, NO_SPRING, GRAVITY, 0.8, MIN_BOUNCE * table.lift)
    return _case("ball_on_table", "ball, restitution 0.8", table, ball, BALL_RPM, 5, 100)


CASES: dict[str, Callable[[], Case]] = {
    make.__name__: make
    for make in (
        *(elastic_stem, resonance, torsional, two_mass_soft, two_mass_stem, one_mass_arc),
        ball_on_table,
    )
}

#: Turns of the cases that are shorter in a quick comparison.
QUICK_TURNS = {"elastic_stem": 2}


def rad_per_s(rpm: float) -> float:
    """Return a speed in rad/s."""
    return rpm * 2.0 * math.pi / 60.0


def _case(
    name: str,
    title: str,
    law: Law,
    model: BenchModel | Twist,
    rpm: float,
    turns: int,
    per_turn: int,
) -> Case:
    speed = rad_per_s(rpm)
    times = output_times(speed, turns, per_turn)
    quick = QUICK_TURNS.get(name, turns)
    caption = f"{title}, {law.name} at {rpm:g} rpm, {turns} turns"
    assert math.isclose(turns * TURN / speed, turns * 60.0 / rpm)
    return Case(name, caption, law, model, speed, turns, quick, times)


# -- samples per second of cam_rig, compared with a copy of the same bytes

CAM = "bezier15"
#: Samples per second.
SAMPLE_RATE = 48_000

SAMPLED = ("kinetostatic", "elastic_stem")

#: Speeds (rpm). At the first a turn has 7200 samples, at the second no whole number of samples.
SPEEDS_RPM = (400.0, 391.37)

#: Samples per block: 6 MB, which fit into a large cache, and 25 MB.
BLOCKS = (1 << 17, 1 << 19)

#: Number of timed blocks, each followed by a copy.
REPEATS = 25


@dataclass(frozen=True)
class SampleRate:
    """Samples of six values per second of a model, and of copies of the same size.

    ``ratio`` is the time of a block relative to that of its copy.
    """

    model: str
    rpm: float
    block: int
    samples_per_s: float
    copied_per_s: float
    ratio: float


def rates() -> dict[str, float]:
    """Return samples per second by model, at the first speed and for shorter blocks."""
    results = sample_rates(SPEEDS_RPM[:1], BLOCKS[:1])
    return {rate.model: rate.samples_per_s for rate in results}


def sample_rates(
    speeds_rpm: Iterable[float] = SPEEDS_RPM, blocks: Iterable[int] = BLOCKS
) -> list[SampleRate]:
    """Return the medians for each model, speed and block. Blocks and copies alternate."""
    law = law_of(CAM)
    follower = FollowerParameters(MASS, SPRING, DAMPING, WEIGHT, STEM)
    speeds, results = tuple(speeds_rpm), []
    for block in blocks:
        source = np.ones((len(COLUMNS), block))
        for rpm in speeds:
            interval = Interval(0, round(block * NS / SAMPLE_RATE), 0.0, rad_per_s(rpm))
            for name in SAMPLED:
                run = partial(MODELS[name].advance, law, follower, None, interval, SAMPLE_RATE)
                pairs = _seconds(run, source.copy)
                made, copied = (statistics.median(times) for times in zip(*pairs, strict=True))
                ratio = statistics.median(run / other for run, other in pairs)
                results.append(SampleRate(name, rpm, block, block / made, block / copied, ratio))
    return results


def rate_table(rates: Iterable[SampleRate]) -> DataTable:
    """Return a table with a row per rate."""
    return tabulate(
        "Samples",
        rates,
        (
            (Header("model"), lambda rate: rate.model),
            (Header("speed", "rpm", "g"), lambda rate: rate.rpm),
            (Header("block", "MB", ".0f"), lambda rate: 8e-6 * len(COLUMNS) * rate.block),
            (Header("samples", "10⁶/s", ".0f"), lambda rate: 1e-6 * rate.samples_per_s),
            (Header("a copy", "10⁶/s", ".0f"), lambda rate: 1e-6 * rate.copied_per_s),
            (Header("time over a copy's", "", ".1f"), lambda rate: rate.ratio),
        ),
    )


def _seconds(*works: Callable[[], object]) -> list[tuple[float, ...]]:
    """Return the wall times (s) of the functions in each round, after a warm-up."""
    times = []
    for _ in range(REPEATS + 1):
        took = []
        for work in works:
            start_time = time.perf_counter()
            work()
            took.append(time.perf_counter() - start_time)
        times.append(tuple(took))
    return times[1:]
