"""What a law comes to by each quantity a design may ask for, exactly, whatever law it is."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise

import numpy as np

from cam_rig.acoustics import RadiationParameters
from cam_rig.acoustics.pressure import mean_square_rate
from cam_rig.acoustics.radiation import level_db, pressure_pa
from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.jump_speed import FROM_REST, rigid_jump_speed
from cam_rig.dynamics.kinetostatic import force_extremes
from cam_rig.errors import ConfigError
from cam_rig.law_design.constraints import SPEEDS, DesignProblem
from cam_rig.law_design.pointwise_search import greatest, level_with_jumps, torque
from cam_rig.law_design.terms import ORDERS, PEAKS, Sense, Term
from cam_rig.law_design.two_mass_contact import MISSED, peaks, speeds_of
from cam_rig.laws import Law, bernstein
from cam_rig.laws.law import peak
from cam_rig.profile.checks import sharpest_convex
from cam_rig.profile.contact import Scan
from cam_rig.profile.disc import discs
from cam_rig.units import TURN, FloatArray

#: Gauss points of a cell of a piece, and the phase (rad) of the vibration in it at most.
GAUSS, CELL_PHASE = 12, 2.0


@lru_cache(maxsize=64)
def measured(problem: DesignProblem, law: Law, term: Term, sense: Sense) -> float:
    """A quantity of a law, SI; the level in dB.

    Over a range of angles or speeds the one that a limit of that sense is about.
    """
    if term.name in PEAKS:
        return abs(peak(law, PEAKS[term.name]).value)
    if term.name in ORDERS:
        return _at_angles(law, term, sense)
    return MEASURES[term.name](problem, law, term)


def _at_angles(law: Law, term: Term, sense: Sense) -> float:
    inside = law.breaks[(law.breaks > term.low) & (law.breaks < term.high)]
    edges = np.array([term.low, *inside, term.high])
    points = np.concatenate([edges, np.linspace(term.low, term.high, 4097)])
    values = law(points, ORDERS[term.name])
    return float(values.max() if sense == "<=" else values.min())


def _rms_acceleration(_: DesignProblem, law: Law, __: Term) -> float:
    points, weights = np.polynomial.legendre.leggauss(law.degree + 1)
    table = bernstein.basis(law.degree, 0.5 * (points + 1.0))
    squares = (table @ law.derivative_ordinates(2)) ** 2
    return math.sqrt(float((0.5 * weights @ squares) @ law.spans) / TURN)


def _residual(problem: DesignProblem, law: Law, term: Term) -> float:
    speeds = speeds_of(problem, term.low, term.high)
    highest = []
    for event in problem.space.events:
        ends = event.start, event.start + event.span
        found = left_by(problem, law, *ends, speeds)
        for speed in peaks(speeds, found, float(found.max()) * (1.0 - MISSED)):
            highest.append(float(left_by(problem, law, *ends, np.array([speed]))[0]))
    return max(highest)


def left_by(
    problem: DesignProblem, law: Law, start: float, end: float, speeds: FloatArray
) -> FloatArray:
    """Amplitude (m) that a law leaves between two angles (rad) from rest, at speeds (rad/s)."""
    mode = problem.mode
    edges = law.breaks[(law.breaks > start) & (law.breaks < end)]
    edges = np.array([start, *edges, end])
    most = CELL_PHASE * float(speeds.min()) / mode.rate.imag
    cut = [np.linspace(a, b, 2 + int((b - a) / most))[:-1] for a, b in pairwise(edges)]
    edges = np.append(np.concatenate(cut), end)
    points, weights = np.polynomial.legendre.leggauss(GAUSS)
    width = np.diff(edges)[:, None]
    angles = (edges[:-1, None] + 0.5 * width * (points + 1.0)).ravel()
    share = (0.5 * width * weights).ravel()
    _, slope, bend = law.motion_at(angles) * share
    found = np.empty(speeds.size)
    for i, speed in enumerate(speeds.tolist()):
        fading = np.exp(mode.rate / speed * (end - angles))
        total = (mode.drive[0] * slope + mode.drive[1] * speed * bend) @ fading
        found[i] = abs(total) / mode.rate.imag
    return found


def _force(problem: DesignProblem, law: Law, term: Term) -> float:
    ends = [force_extremes(law, problem.rigid, speed) for speed in {term.low, term.high}]
    if term.name == "peak_contact_force_rigid":
        return max(largest for _, largest in ends)
    return min(least for least, _ in ends)


def _jump(problem: DesignProblem, law: Law, term: Term) -> float:
    duration = FROM_REST if term.name == "jump_speed" else None
    return find_jump(law, problem.follower, duration).speed


def _level(problem: DesignProblem, law: Law, term: Term) -> float:
    radiation = RadiationParameters.from_rig(problem.rig, lands=False)
    rates = [
        mean_square_rate(law, problem.rigid, radiation.corner_rate, speed)
        for speed in np.linspace(term.low, term.high, SPEEDS).tolist()
    ]
    return level_of(problem, term, math.sqrt(float(np.mean(rates))))


def _background(radiation: RadiationParameters, term: Term) -> float:
    speeds = np.linspace(term.low, term.high, SPEEDS)
    return float(np.mean([radiation.background_power(speed) for speed in speeds.tolist()]))


def level_of(problem: DesignProblem, term: Term, rate: float) -> float:
    """The level (dB) of a mean square rate's root (N/s), with the background."""
    radiation = RadiationParameters.from_rig(problem.rig, lands=False)
    power = _background(radiation, term) + (radiation.gain * rate) ** 2
    return float(level_db(np.array([math.sqrt(power)]))[0])


def rate_of(problem: DesignProblem, term: Term, level: float) -> float:
    """The other way; not above zero where the background alone is as loud."""
    radiation = RadiationParameters.from_rig(problem.rig, lands=False)
    power = float(pressure_pa(level)) ** 2 - _background(radiation, term)
    return math.copysign(math.sqrt(abs(power)), power) / radiation.gain


def _pressure(problem: DesignProblem, law: Law, _: Term) -> float:
    plates = discs(problem.cam.follower, law)
    scans = [Scan(law, plate.element) for plate in plates]
    return max(scan.greatest(lambda touch: np.abs(touch.pressure)).value for scan in scans)


def _radius(problem: DesignProblem, law: Law, _: Term) -> float:
    scans = [Scan(law, plate.element) for plate in discs(problem.cam.follower, law)]
    return min(float(sharpest_convex(scan).value) for scan in scans)


def _torque(problem: DesignProblem, law: Law, term: Term) -> float:
    return greatest(law, torque(problem.rigid, term.low, term.high))


def _span(problem: DesignProblem, _: Law, term: Term) -> float:
    events = problem.space.events
    if term.event > len(events):
        raise ConfigError(
            f"{term.key}: {problem.cam.name!r} has {len(events)} events; allowed: 1 to that"
        )
    return events[term.event - 1].span


MEASURES: dict[str, Callable[[DesignProblem, Law, Term], float]] = {
    "rms_acceleration": _rms_acceleration,
    "residual_vibration": _residual,
    "peak_contact_force_rigid": _force,
    "least_contact_force_rigid": _force,
    "jump_speed": _jump,
    "jump_speed_steady": _jump,
    "jump_speed_rigid": lambda problem, law, _: rigid_jump_speed(law, problem.rigid),
    "sound_level_rigid": _level,
    "pressure_angle": _pressure,
    "radius_of_curvature": _radius,
    "shaft_torque": _torque,
    "event_angle": _span,
    "sound_level_with_jumps": level_with_jumps,
}
