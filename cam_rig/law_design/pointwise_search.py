"""What depends on s, s', s'' at one cam angle only, and is not convex: torque, radius, pressure.

Each is a few functions of the follower's motion, of which the greatest over the turn counts. Near
a law they are linear in the unknowns, by their slopes in s, s' and s''.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy import sparse

from cam_rig.acoustics import RadiationParameters
from cam_rig.dynamics import FollowerParameters
from cam_rig.law_design.constraints import DesignProblem
from cam_rig.law_design.convex_program import Affine
from cam_rig.law_design.space import dwells
from cam_rig.law_design.terms import Term
from cam_rig.laws import Law
from cam_rig.profile.contact import Motion, Touch, zoom
from cam_rig.profile.disc import discs
from cam_rig.simulation.simulate import Acoustics, settled_turns
from cam_rig.units import FloatArray

#: A quantity's branches ``(b, ...)`` of motions of one shape: the greatest is the worst.
Branches = Callable[[Motion], FloatArray]

#: Samples of a piece, at least, and of a turn; local maxima that are no lower than this part of
#: the greatest are found to rounding.
SAMPLES, SAMPLES_OF_TURN, NEARLY = 65, 4096, 0.02

#: Slopes are central differences over this part of the largest s, s' or s''.
STEP = 1e-5

#: A joint is looked at so much of a piece before and behind it.
BESIDE = 1e-6


def torque(follower: FollowerParameters, low: float, high: float) -> Branches:
    """±(k s + c Ω s' + m Ω² s'' + F₀) s' at both ends of a range of speeds, and where it turns.

    Of one rigid mass that stays on the cam (eq. 8 of the paper). In Ω it is a parabola, which may
    be greatest between the ends.
    """
    p = follower

    def branches(motion: Motion) -> FloatArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            turns = -0.5 * p.damping * motion.slope / (p.mass * motion.bend)
        between = np.clip(np.where(np.isnan(turns), low, turns), low, high)
        found = []
        for speed in dict.fromkeys((low, high)):
            found.append(_torque(p, motion, np.full(motion.s.shape, speed)))
        if low < high:
            found.append(_torque(p, motion, between))
        return np.concatenate([found, np.negative(found)])

    return branches


def _torque(p: FollowerParameters, motion: Motion, speed: FloatArray) -> FloatArray:
    force = p.spring_stiffness * motion.s + p.preload
    force = force + (p.damping * motion.slope + p.mass * speed * motion.bend) * speed
    return np.asarray(force * motion.slope)


def pressure(problem: DesignProblem) -> Branches:
    """± the pressure angle (rad) on each disc."""
    return _on_discs(problem, lambda touch: [touch.pressure, -touch.pressure])


def sharpness(problem: DesignProblem) -> Branches:
    """Curvature of the pitch curve (1/m) on each disc; under a face less the radius (m)."""

    def of_touch(touch: Touch) -> list[FloatArray]:
        return [-touch.radius if touch.pitch_curvature is None else touch.pitch_curvature]

    return _on_discs(problem, of_touch)


def _on_discs(problem: DesignProblem, quantity: Callable[[Touch], list[FloatArray]]) -> Branches:
    elements = [plate.element for plate in discs(problem.cam.follower, problem.start)]

    def branches(motion: Motion) -> FloatArray:
        return np.array([row for element in elements for row in quantity(element.touch(motion))])

    return branches


def greatest(law: Law, branches: Branches) -> float:
    """The greatest value of all branches over the turn; infinite where one is not a number."""
    return max(value for value, _ in maxima(law, branches))


def maxima(law: Law, branches: Branches) -> list[tuple[float, float]]:
    """Of each piece the greatest value and its angle (rad), where it is near the turn's."""
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


@dataclass(frozen=True, eq=False)
class PointwiseTerm:
    """A goal (``allowed`` None) or a limit on the greatest value of a quantity's branches."""

    problem: DesignProblem
    name: str
    branches: Branches
    allowed: float | None

    @cached_property
    def scale(self) -> float:
        """What its rows are measured by: the largest size of a branch on the start."""
        u = np.linspace(0.0, 1.0, SAMPLES)
        values = np.abs(self.branches(Motion.on_pieces(self.problem.start, u)))
        return float(values[np.isfinite(values)].max(initial=0.0)) or 1.0

    def worst(self, law: Law) -> float:
        """The greatest value."""
        return greatest(law, self.branches)

    @property
    def at_rest(self) -> float:
        """Its value in the dwells, which no law of the class changes; −∞ without one."""
        levels = [self.problem.start.lift_at(start) for start, _ in dwells(self.problem.start)]
        if not levels:
            return -np.inf
        motion = Motion(np.zeros(len(levels)), np.array(levels), *np.zeros((2, len(levels))))
        return float(self.branches(motion).max())

    @cached_property
    def _grid(self) -> FloatArray:
        """Angles in all pieces of the events, on both sides of the joints between them."""
        space = self.problem.space
        parts = (np.arange(space.parts) + 0.5) / space.parts
        inner = space.law_class.pieces
        found = []
        for event in space.events:
            joints = np.arange(1, inner)[:, None] + np.array([-BESIDE, BESIDE])
            places = np.concatenate([(np.arange(inner)[:, None] + parts).ravel(), joints.ravel()])
            found.append(event.start + event.span / inner * places)
        return np.concatenate(found)

    def _inside(self, angles: FloatArray) -> FloatArray:
        """Those of the angles that are in events and not at their ends, where nothing is free."""
        space = self.problem.space
        least = 0.25 / (space.law_class.pieces * space.parts)
        place = [(angles - event.start) / event.span for event in space.events]
        inside = [(least < u) & (u < 1.0 - least) for u in place]
        return np.asarray(angles[np.any(inside, axis=0)])

    def rows(self, unknowns: FloatArray, tried: list[FloatArray]) -> Affine:
        """The branches near a law as functions of the unknowns, over the events and at its maxima.

        Where laws were ``tried`` from there their maxima are among them, and the rows give the
        exact values of the last one.
        """
        space = self.problem.space
        laws = [space.law(x, "design") for x in (unknowns, *tried)]
        tops = np.array([angle for law in laws for _, angle in maxima(law, self.branches)])
        at = np.concatenate([self._grid, self._inside(tops)])
        parts = [space.at(order, at) for order in range(3)]
        motion = Motion(at, *(part(unknowns) for part in parts))
        slopes = [self._slope(motion, order) for order in range(3)]
        found = []
        for branch, value in enumerate(self.branches(motion)):
            total = Affine(value, sparse.csr_array(parts[0].matrix.shape))
            for part, slope in zip(parts, slopes, strict=True):
                weight = sparse.csr_array(sparse.diags(slope[branch]))
                total = total + part.plus(-part(unknowns)).mapped(weight)
            found.append(total)
        rows = Affine.stacked(found)
        if tried:
            exact = self.branches(Motion(at, *(part(tried[-1]) for part in parts)))
            rows = rows.plus(exact.ravel() - rows(tried[-1]))
        return rows

    def _slope(self, motion: Motion, order: int) -> FloatArray:
        """By how much the branches grow with s, s' or s''."""
        name = ("s", "slope", "bend")[order]
        own = getattr(motion, name)
        step = STEP * float(np.abs(own).max())
        high, low = (
            self.branches(replace(motion, **{name: own + sign * step})) for sign in (1.0, -1.0)
        )
        return np.asarray((high - low) / (2.0 * step))


def pointwise(problem: DesignProblem, term: Term) -> Branches:
    """The branches of a quantity."""
    if term.name == "shaft_torque":
        return torque(problem.rigid, term.low, term.high)
    return pressure(problem) if term.name == "pressure_angle" else sharpness(problem)


def as_branch(problem: DesignProblem, term: Term, value: float) -> float:
    """A limit's value (SI) as one on the branches."""
    if term.name != "radius_of_curvature":
        return value
    motion = Motion.on_pieces(problem.start, np.zeros(1))
    plate = discs(problem.cam.follower, problem.start)[0].element
    has_centre = plate.touch(motion).pitch_curvature is not None
    return 1.0 / (value + plate.roller) if has_centre else -value


# The sound level where contact may be lost: flights and landings of one mass, exactly simulated.

#: Speeds over which the mean power of a range is taken: a turn of each is simulated.
SPEEDS = 13

#: Slopes are central differences over this part of the lift: flights begin and end within it.
LEVEL_STEP = 1e-3


def level_with_jumps(problem: DesignProblem, law: Law, term: Term) -> float:
    """The level (dB) of the mean power over a range of speeds, settled turns, with landings."""
    count = 1 if term.low == term.high else SPEEDS
    turns = settled_turns(law, "one_mass", problem.rigid, np.linspace(term.low, term.high, count))
    levels = Acoustics(RadiationParameters.from_rig(problem.rig)).levels(turns)
    power = float(np.mean(10.0 ** (0.1 * (levels - levels.max()))))
    return float(levels.max() + 10.0 * np.log10(power))


@dataclass(frozen=True, eq=False)
class FlightLevel:
    """A goal (``allowed`` None) or a limit on that level, dB."""

    problem: DesignProblem
    name: str
    term: Term
    allowed: float | None
    scale: float = 10.0

    def worst(self, law: Law) -> float:
        """The level."""
        return level_with_jumps(self.problem, law, self.term)

    def rows(self, unknowns: FloatArray, tried: list[FloatArray]) -> Affine:
        """The level near a law; the exact one of the last law that was tried from there."""
        at, slope = tried[-1] if tried else unknowns, self._slope(unknowns.tobytes())
        constant = self._level(at) - slope @ at
        return Affine(constant, sparse.csr_array(slope))

    @lru_cache(maxsize=1)  # noqa: B019 - a term lives as long as its search
    def _slope(self, unknowns: bytes) -> FloatArray:
        """By how much the level grows with each unknown, ``(1, m)``; a step is tried more often."""
        space = self.problem.space
        free = np.frombuffer(unknowns)[: space.unknowns - space.link.constant.size]
        slope = np.zeros((1, space.unknowns))
        for index in range(free.size):
            step = np.zeros(free.size)
            step[index] = LEVEL_STEP
            high, low = (self._level(space.joined(free + sign * step)) for sign in (1.0, -1.0))
            slope[0, index] = (high - low) / (2.0 * LEVEL_STEP)
        return slope

    def _level(self, unknowns: FloatArray) -> float:
        return self.worst(self.problem.space.law(unknowns, "design"))
