"""What a design is asked for: a goal, limits, a class of laws, and how it is searched for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field, model_validator

from cam_rig.errors import ConfigError
from cam_rig.quantities.catalogue import DESIGNED
from cam_rig.quantities.terms import Limit, Sense, Term, parse_limit, parse_term
from cam_rig.schema.load import read_yaml
from cam_rig.schema.quantity import Strict
from cam_rig.units import FloatArray


class ClassConfig(Strict):
    """B-splines of a degree in equal pieces of each event; ``joints`` such as C3."""

    pieces: int = Field(default=16, strict=True)
    joints: str = "C3"
    degree: int | None = Field(default=None, strict=True)


class DesignConfig(Strict):
    """One design file; ``start`` and ``rig`` are files (from where one is), or shipped names."""

    start: str
    rig: str = "paper_table2"
    name: str | None = Field(default=None, pattern=r"^[a-z][a-z0-9_]*$")
    minimise: str | None = None
    maximise: str | None = None
    limits: list[str] = Field(default_factory=list)
    keep: list[str] = Field(default_factory=lambda: ["events", "dwells", "lift"])
    starts: int = Field(default=8, strict=True)
    seed: int = Field(default=1, strict=True)
    class_: ClassConfig = Field(default=ClassConfig(), alias="class")

    @model_validator(mode="after")
    def _one_goal(self) -> DesignConfig:
        if (self.minimise is None) == (self.maximise is None):
            raise ValueError("minimise, maximise: allowed: exactly one of them")
        return self


def is_design(path: Path) -> bool:
    """Whether a file is a design and not a cam."""
    if not path.is_file():
        return False
    data = read_yaml(path)
    return isinstance(data, dict) and "start" in data


#: Pieces and degree of a class, and how smooth its joints may be.
MAX_PIECES, MAX_DEGREE, MAX_JOINTS = 200, 15, 6
#: An event of more ordinates than this is not written to a cam file.
MAX_ORDINATES = 500


@dataclass(frozen=True)
class LawClass:
    """B-splines in equal pieces of each event, Cᵏ by ``joints`` k; of degree k + 2 by default."""

    pieces: int = 16
    joints: int = 3
    degree: int | None = None

    def __post_init__(self) -> None:
        limits = {"pieces": (1, MAX_PIECES), "joints": (1, MAX_JOINTS), "degree": (2, MAX_DEGREE)}
        for name, (least, most) in limits.items():
            value = self.power if name == "degree" else getattr(self, name)
            if not isinstance(value, int) or not least <= value <= most:
                raise ConfigError(f"class: {name} is {value}; allowed: {least} to {most}")
        if self.power <= self.joints:
            raise ConfigError(
                f"class: degree is {self.power} with joints C{self.joints}; allowed: a degree "
                f"above {self.joints}"
            )
        if self.free < 1:
            raise ConfigError(
                f"class: {self.count} ordinates, of which the ends take {2 * self.joints + 2}; "
                f"allowed: at least {2 * self.joints + 3}, so more pieces or a higher degree"
            )
        if self.count > MAX_ORDINATES:
            raise ConfigError(
                f"class: {self.count} ordinates an event; allowed: {MAX_ORDINATES}, so fewer "
                "pieces, a lower degree or smoother joints"
            )

    @property
    def power(self) -> int:
        """The degree."""
        return self.joints + 2 if self.degree is None else self.degree

    @property
    def knots(self) -> FloatArray:
        """Of one event of unit length, the ends ``degree + 1`` times."""
        inner = np.repeat(np.arange(1.0, self.pieces) / self.pieces, self.power - self.joints)
        ends = self.power + 1
        return np.concatenate([np.zeros(ends), inner, np.ones(ends)])

    @property
    def count(self) -> int:
        """Ordinates of one event."""
        return (self.pieces - 1) * (self.power - self.joints) + self.power + 1

    @property
    def free(self) -> int:
        """Those that the ends do not take."""
        return self.count - 2 * (self.joints + 1)

    @property
    def words(self) -> str:
        """The class as a table says it."""
        if self.pieces == 1:
            return f"Bézier curves of degree {self.power}"
        return f"B-splines of degree {self.power} in {self.pieces} pieces, C{self.joints} joints"


#: Starts, at most, and by default.
MOST_STARTS, STARTS = 1000, 8
#: Descents that end within this part of the best came to the same.
SAME = 1e-3


@dataclass(frozen=True)
class Multistart:
    """A search from several laws, of which so many (``near``) ended within 0.1 % of the best."""

    starts: int = STARTS
    seed: int = 1
    near: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.starts <= MOST_STARTS:
            raise ConfigError(f"starts: is {self.starts}; allowed: 1 to {MOST_STARTS}")
        if self.seed < 0:
            raise ConfigError(f"seed: is {self.seed}; allowed: 0 and above")

    @property
    def words(self) -> str:
        """As a table says it."""
        starts = "1 start" if self.starts == 1 else f"{self.starts} starts"
        return f"local ({starts}, {self.near} ended within 0.1 % of the best)"


#: What of the start may stay: all of it, or its events have other spans, or its dwells too.
KEEP = (("events", "dwells", "lift"), ("dwells", "lift"), ("lift",))


def _kept(keep: Sequence[str], limits: Sequence[Limit]) -> tuple[str, ...]:
    """What stays, in order."""
    found = [own for own in KEEP if set(own) == {word.strip() for word in keep}]
    if not found:
        allowed = " or ".join(",".join(own) for own in KEEP)
        raise ConfigError(f"keep: is {','.join(keep)!r}; allowed: {allowed}")
    if "events" in found[0] and any(x.term.quantity.where == "event" for x in limits):
        raise ConfigError("limit event_angle: events stay; allowed: with keep dwells,lift or lift")
    return found[0]


def parse_goal(text: str) -> Term:
    """A goal: a quantity that may be one."""
    term = parse_term(text, DESIGNED)
    if not term.quantity.goal:
        goals = [name for name, quantity in DESIGNED.items() if quantity.goal]
        raise ConfigError(f"{term.name} is a limit, not a goal; goals: {', '.join(goals)}")
    return term


def parse_second(text: str) -> Term:
    """The other quantity of a front: what may be a goal, or an event's span."""
    term = parse_term(text, DESIGNED)
    return term if term.quantity.where == "event" else parse_goal(text)


@dataclass(frozen=True)
class DesignRequest:
    """What is asked: a goal with its sense, limits, the class of laws, and how it is searched."""

    goal: Term
    sense: Sense
    limits: tuple[Limit, ...]
    law_class: LawClass
    multistart: Multistart
    keep: tuple[str, ...]

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
        """From words."""
        if (minimise is None) == (maximise is None):
            raise ConfigError("goal: needed: one, to minimise or to maximise")
        goal = parse_goal(minimise or maximise or "")
        sense: Sense = "<=" if minimise is not None else ">="
        if sense not in goal.quantity.senses:
            other = "maximise" if sense == "<=" else "minimise"
            raise ConfigError(f"goal {goal.key}: allowed: {other}; the other way is not convex")
        asked = tuple(parse_limit(text, DESIGNED) for text in limits)
        own, kept = law_class or LawClass(), _kept(keep, asked)
        for term in (goal, *(limit.term for limit in asked)):
            order = term.quantity.order
            if own.joints < order - 1:
                raise ConfigError(
                    f"{term.key}: has no bound with joints C{own.joints}, where a lower "
                    f"derivative may step; allowed: C{order - 1} and above"
                )
        return cls(goal, sense, asked, own, multistart or Multistart(), kept)

    @classmethod
    def of_config(cls, config: DesignConfig) -> DesignRequest:
        """From a design file."""
        own = config.class_
        if not (own.joints[:1] in ("C", "c") and own.joints[1:].isdecimal()):
            raise ConfigError(f"joints: are {own.joints!r}; allowed: C1 to C{MAX_JOINTS}")
        law_class = LawClass(own.pieces, int(own.joints[1:]), own.degree)
        search = Multistart(config.starts, config.seed)
        asked = config.model_dump(include={"minimise", "maximise", "limits", "keep"})
        return cls.of(law_class=law_class, multistart=search, **asked)

    @property
    def verb(self) -> str:
        """Minimise or maximise."""
        return "minimise" if self.sense == "<=" else "maximise"

    @property
    def words(self) -> str:
        """As a title says it."""
        return f"{self.verb} {self.goal.words}"
