"""The six cases: which law, which numbers, how long."""

from __future__ import annotations

import math
from collections.abc import Callable

from cam_rig.bench.cases.case import Case, output_times
from cam_rig.bench.cases.models import BenchModel, OneMass, Oscillator, Twist, TwoMasses
from cam_rig.laws import Law, build_law
from cam_rig.schema.load import config_root, load_cam
from cam_rig.units import TURN

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
    for make in (
        elastic_stem,
        resonance,
        torsional,
        two_mass_soft,
        two_mass_stem,
        one_mass_arc,
    )
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
