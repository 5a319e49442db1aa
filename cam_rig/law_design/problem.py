"""A design's problem: the space of laws, the rig and the follower; a goal or a limit of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.any_follower import AnyFollower, follower_of
from cam_rig.law_design.convex_program import Affine
from cam_rig.law_design.space import Space
from cam_rig.laws import Law
from cam_rig.profile.contact import Element
from cam_rig.profile.disc import discs
from cam_rig.quantities.mode import Mode
from cam_rig.quantities.terms import Limit, Sense, Term, sign_of
from cam_rig.quantities.values import Subject, mode_of
from cam_rig.schema import CamConfig, RigConfig

#: Limits are kept with so much of their scale to spare: rounding of the solver and of the file.
SPARE = 2e-8


@dataclass(frozen=True, eq=False)
class DesignProblem:
    """What rows of a program are made of; ``free`` is what the start's cam has elsewhere."""

    cam: CamConfig
    start: Law
    rig: RigConfig
    space: Space
    free: tuple[str, ...] = ()

    @cached_property
    def rigid(self) -> FollowerParameters:
        """The follower as one rigid mass."""
        return FollowerParameters.from_rig(self.rig)

    @cached_property
    def follower(self) -> AnyFollower:
        """Of two masses where the rig says how they split."""
        return follower_of(self.rig)

    @property
    def two_masses(self) -> bool:
        """Whether it is."""
        return isinstance(self.follower, TwoMassParameters)

    @cached_property
    def mode(self) -> Mode:
        """Of that follower on its stem."""
        return mode_of(self.rig)

    @cached_property
    def force_scale(self) -> float:
        """The force (N) that forces are measured by: preload, or the spring at half the lift."""
        return self.rigid.preload or 0.5 * self.rigid.spring_stiffness * self.start.lift

    @cached_property
    def element(self) -> Element | None:
        """The contact of a cam of one disc whose follower has no inclined face."""
        plates = discs(self.cam.follower, self.start)
        element = plates[0].element
        inclined = getattr(element, "inclination", 0.0) != 0.0
        return None if len(plates) > 1 or inclined else element


@lru_cache(maxsize=64)
def measured(problem: DesignProblem, law: Law, term: Term, sense: Sense) -> float:
    """A quantity of a law, SI; the level in dB."""
    events = [(event.start, event.span) for event in problem.space.events]
    return term.quantity.value(Subject(law, problem.rig, problem.cam, events), term, sense)


@dataclass(frozen=True)
class Asked:
    """A goal (``value`` None) or a limit, with what its rows are measured by (SI)."""

    term: Term
    sense: Sense
    value: float | None
    scale: float

    @property
    def name(self) -> str:
        """As the request says it, for the table of active limits."""
        if self.value is None:
            return f"goal {self.term.key}"
        return Limit(self.term, self.sense, self.value).words

    @property
    def weight(self) -> float:
        """Of the level t in the rows."""
        return -1.0 if self.value is None else 0.0

    def room(self, quantity: Affine, spare: float) -> Affine:
        """Rows that are ≥ 0 where the limit is kept."""
        rows = quantity * (-sign_of(self.sense) / self.scale)
        if self.value is None:
            return rows
        return rows.plus(sign_of(self.sense) * self.value / self.scale - spare)
