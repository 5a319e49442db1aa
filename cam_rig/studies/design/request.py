"""What a design is asked for: a goal, limits, a class of laws, and how it is searched for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from cam_rig.errors import ConfigError
from cam_rig.schema.studies.design import DesignConfig
from cam_rig.studies.design.constraints import PEAKS
from cam_rig.studies.design.law_class import LawClass
from cam_rig.studies.design.local.multistart import Multistart
from cam_rig.studies.design.quantities import Sense
from cam_rig.studies.design.terms import Limit, Term, parse_goal, parse_limit

#: What of the start may stay: all of it, or its events have other spans, or its dwells too.
KEEP = (("events", "dwells", "lift"), ("dwells", "lift"), ("lift",))


def _kept(keep: Sequence[str], limits: Sequence[Limit]) -> tuple[str, ...]:
    """What stays, in order.

    Raises
    ------
    ConfigError : none of `KEEP`, or a limit on an event that stays
    """
    found = [own for own in KEEP if set(own) == {word.strip() for word in keep}]
    if not found:
        allowed = " or ".join(",".join(own) for own in KEEP)
        raise ConfigError(f"keep: is {','.join(keep)!r}; allowed: {allowed}")
    if "events" in found[0] and any(limit.term.name == "event_angle" for limit in limits):
        raise ConfigError("limit event_angle: events stay; allowed: with keep dwells,lift or lift")
    return found[0]


@dataclass(frozen=True)
class DesignRequest:
    """What is asked: a goal with its sense, limits, the class of laws, and how it is searched.

    Examples
    --------
    >>> request = DesignRequest.of(maximise="jump_speed", limits=["peak_acceleration<=start"])
    >>> request.words
    'maximise jump speed from rest'
    """

    goal: Term
    sense: Sense
    limits: tuple[Limit, ...] = ()
    law_class: LawClass = field(default_factory=LawClass)
    multistart: Multistart = field(default_factory=Multistart)
    keep: tuple[str, ...] = KEEP[0]

    @classmethod
    def of(
        cls,
        *,
        minimise: str | None = None,
        maximise: str | None = None,
        limits: Sequence[str] = (),
        law_class: LawClass | None = None,
        multistart: Multistart | None = None,
        keep: Sequence[str] = KEEP[0],
    ) -> DesignRequest:
        """From words.

        Raises
        ------
        ConfigError : not one goal, one that is not convex that way, or a limit that is none
        """
        if (minimise is None) == (maximise is None):
            raise ConfigError("goal: needed: one, to minimise or to maximise")
        goal = parse_goal(minimise or maximise or "")
        sense: Sense = "<=" if minimise is not None else ">="
        if sense not in goal.quantity.senses:
            other = "maximise" if sense == "<=" else "minimise"
            raise ConfigError(f"goal {goal.key}: allowed: {other}; the other way is not convex")
        asked = tuple(map(parse_limit, limits))
        found = cls(
            goal,
            sense,
            asked,
            law_class or LawClass(),
            multistart or Multistart(),
            _kept(keep, asked),
        )
        for term in (goal, *(limit.term for limit in found.limits)):
            order = PEAKS.get(term.name, 0)
            if found.law_class.joints < order - 1:
                raise ConfigError(
                    f"{term.key}: has no bound with joints C{found.law_class.joints}, where a "
                    f"lower derivative may step; allowed: C{order - 1} and above"
                )
        return found

    @classmethod
    def of_config(cls, config: DesignConfig) -> DesignRequest:
        """From a design file.

        Raises
        ------
        ConfigError : as `of`, or a class that is none
        """
        own = config.class_
        return cls.of(
            minimise=config.minimise,
            maximise=config.maximise,
            limits=config.limits,
            law_class=LawClass.of(own.pieces, own.joints, own.degree),
            multistart=Multistart(config.starts, config.seed),
            keep=config.keep,
        )

    @property
    def verb(self) -> str:
        """Minimise or maximise."""
        return "minimise" if self.sense == "<=" else "maximise"

    @property
    def words(self) -> str:
        """As a title says it."""
        return f"{self.verb} {self.goal.words}"
