"""The six cases: which law, which numbers, how long."""

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
from cam_rig.schema.load import config_root, load_cam
from cam_rig.show.tables import DataTable, Header, tabulate
from cam_rig.units import NS, TURN

#: Table 1 of the paper, and what is assumed with it.
MASS, SPRING, STEM, DAMPING = 1.3, 4030.0, 3.3e8, 8.642

WEIGHT = 12.753

#: Identified from the paper's jump speeds (its Table 2).
SOFT_STEM, ROLLER_SHARE, PRELOAD = 1.26e6, 0.40, 30.6

#: Bounces lower than this fraction of the lift are contact.
MIN_BOUNCE = 1e-12


def law_of(cam: str) -> Law:
    """The law of a shipped cam."""
    return build_law(load_cam(config_root() / "cams" / f"{cam}.yaml"))


def elastic_stem() -> Case:
    """A stiff oscillator, driven smoothly, hardly damped."""
    model = Oscillator(MASS, DAMPING, SPRING, STEM)
    return _case("elastic_stem", "residual vibration on the stem", "poly345", model, 300, 20, 25)


def resonance() -> Case:
    """The ninth harmonic of the cam meets an undamped follower: the response grows for ever.

    The even harmonics of this cam are zero: its fall is its rise, half a turn later.
    """
    stiffness = MASS * (9.0 * rad_per_s(300)) ** 2
    model = Oscillator(MASS, 0.0, SPRING, stiffness - SPRING)
    return _case("resonance", "undamped resonance, ω_n = 9 ω", "poly345", model, 300, 20, 25)


def torsional() -> Case:
    """An elastic camshaft, nonlinear in the twist."""
    model = Twist(0.02, 1e4, MASS, DAMPING, SPRING, WEIGHT)
    return _case("torsional", "torsional vibration", "poly345", model, 400, 4, 50)


def _two_mass(name: str, title: str, stem_stiffness: float, preload: float) -> Case:
    roller = ROLLER_SHARE * MASS
    model = TwoMasses(roller, MASS - roller, stem_stiffness, SPRING, DAMPING, DAMPING, preload)
    return _case(name, title, "poly345", model, 450, 2, 97)


def two_mass_soft() -> Case:
    """Two masses that leave the cam, with the stem stiffness identified from the paper."""
    return _two_mass("two_mass_soft", "two masses, stem 1.26e6 N/m", SOFT_STEM, PRELOAD)


def two_mass_stem() -> Case:
    """Two masses that leave the cam, with the printed stem stiffness: they land and chatter.

    The preload is the follower's weight: with the identified 30.6 N nothing lifts off here.
    """
    return _two_mass("two_mass_stem", "two masses, stem 3.3e8 N/m", STEM, WEIGHT)


def one_mass_arc() -> Case:
    """A rigid follower that jumps off an arc cam and bounces back onto it."""
    bounce = MIN_BOUNCE * law_of("tm21").lift
    model = OneMass(MASS, DAMPING, SPRING, WEIGHT, 0.8, bounce)
    return _case("one_mass_arc", "one mass, arc cam, restitution 0.8", "tm21", model, 400, 10, 50)


CASES: dict[str, Callable[[], Case]] = {
    make.__name__: make
    for make in (elastic_stem, resonance, torsional, two_mass_soft, two_mass_stem, one_mass_arc)
}

#: Turns of the cases that a quick study cuts short.
QUICK_TURNS = {"elastic_stem": 2}


def rad_per_s(rpm: float) -> float:
    """Speed in rad/s."""
    return rpm * 2.0 * math.pi / 60.0


def _case(
    name: str,
    title: str,
    cam: str,
    model: BenchModel | Twist,
    rpm: float,
    turns: int,
    per_turn: int,
) -> Case:
    speed = rad_per_s(rpm)
    times = output_times(speed, turns, per_turn)
    quick = QUICK_TURNS.get(name, turns)
    words = f"{title}, {cam} at {rpm:g} rpm, {turns} turns"
    assert math.isclose(turns * TURN / speed, turns * 60.0 / rpm)
    return Case(name, words, law_of(cam), model, speed, turns, quick, times)


# How many samples the rig makes in a second, beside a copy of the same bytes.

CAM, SAMPLE_RATE = "bezier15", 48_000

SAMPLED = ("kinetostatic", "elastic_stem")

#: At the first a turn is 7200 samples, at the second no whole number of them.
SPEEDS_RPM = (400.0, 391.37)

#: Samples in a block: 6 MB, which a large cache still holds, and 25 MB.
BLOCKS = (1 << 17, 1 << 19)

#: Blocks that are timed, each beside a copy.
REPEATS = 25


@dataclass(frozen=True)
class SampleRate:
    """Samples of six numbers a second of a model at a speed, and of copies, one after each block.

    ``ratio`` is how many times as long as the copy beside it a block takes.
    """

    model: str
    rpm: float
    block: int
    samples_per_s: float
    copied_per_s: float
    ratio: float


def rates() -> dict[str, float]:
    """Samples per second by model, at the first speed, in the shorter blocks."""
    found = sample_rates(SPEEDS_RPM[:1], BLOCKS[:1])
    return {rate.model: rate.samples_per_s for rate in found}


def sample_rates(
    speeds_rpm: Iterable[float] = SPEEDS_RPM, blocks: Iterable[int] = BLOCKS
) -> list[SampleRate]:
    """Each model, speed and block: medians, every run in turn with a copy."""
    law = law_of(CAM)
    follower = FollowerParameters(MASS, SPRING, DAMPING, WEIGHT, STEM)
    speeds, found = tuple(speeds_rpm), []
    for block in blocks:
        source = np.ones((len(COLUMNS), block))
        for rpm in speeds:
            interval = Interval(0, round(block * NS / SAMPLE_RATE), 0.0, rad_per_s(rpm))
            for name in SAMPLED:
                run = partial(MODELS[name].advance, law, follower, None, interval, SAMPLE_RATE)
                pairs = _seconds(run, source.copy)
                made, copied = (statistics.median(times) for times in zip(*pairs, strict=True))
                ratio = statistics.median(one / other for one, other in pairs)
                found.append(SampleRate(name, rpm, block, block / made, block / copied, ratio))
    return found


def rate_table(rates: Iterable[SampleRate]) -> DataTable:
    """A row for each rate."""
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
    """Wall times of each round, all in turn, after one that fills the caches."""
    times = []
    for _ in range(REPEATS + 1):
        took = []
        for work in works:
            begun = time.perf_counter()
            work()
            took.append(time.perf_counter() - begun)
        times.append(tuple(took))
    return times[1:]
