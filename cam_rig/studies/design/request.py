"""Request of a design: goal, limits, class of laws, and options of the search.

A design starts from a given law, the start law, and searches for the best law of a class.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field, model_validator

from cam_rig.errors import ConfigError
from cam_rig.quantities.catalogue import DESIGN_QUANTITIES
from cam_rig.quantities.terms import Limit, Sense, Term, parse_limit, parse_term
from cam_rig.schema.load import read_yaml
from cam_rig.schema.quantity import Strict
from cam_rig.units import FloatArray


class ClassConfig(Strict):
    """Section ``class`` of a design file: the class of laws to search.

    The laws are B-splines. Each event (motion between two dwells) is cut into ``pieces`` polynomial
    pieces of equal span. ``joints`` is the continuity between the pieces, such as C3. ``degree`` is
    the degree of the splines, or None for k + 2 if ``joints`` is Cᵏ.
    """

    pieces: int = Field(default=16, strict=True)
    joints: str = "C3"
    degree: int | None = Field(default=None, strict=True)


class DesignConfig(Strict):
    """Content of a design file, the YAML form of a design request.

    ``start`` is the cam file whose law the design starts from, and ``rig`` the rig file. Both are
    paths relative to the folder of the design file, or names of shipped files. Exactly one of
    ``minimise`` and ``maximise`` must be set.
    """

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
            raise ValueError("exactly one of minimise and maximise is required")
        return self


def is_design(path: Path) -> bool:
    """Return True if a file is a design file and not a cam file."""
    if not path.is_file():
        return False
    data = read_yaml(path)
    return isinstance(data, dict) and "start" in data


#: Largest number of polynomial pieces into which an event (motion between two dwells) can be
#: divided.
MAX_PIECES = 200
#: Largest polynomial degree of a designed law.
MAX_DEGREE = 15
#: Largest order k of continuity Cᵏ between the polynomial pieces of a designed law.
MAX_JOINTS = 6
#: Largest number of B-spline ordinates (control values) per event, the motion between two dwells.
#: It is the same in a cam file.
MAX_ORDINATES = 500


@dataclass(frozen=True)
class LawClass:
    """Class of laws that are B-splines in equal pieces of each event.

    An event is the motion between two dwells.

    Parameters
    ----------
    pieces : int, optional
        Number of pieces per event, 1 to 200 (default: 16).
    joints : int, optional
        Order k of continuity Cᵏ at the joints, 1 to 6 (default: 3).
    degree : int, optional
        Degree, up to 15 (default: ``joints`` + 2).

    Raises
    ------
    ConfigError
        If a value is out of range, or the number of free ordinates is zero or too large.
    """

    pieces: int = 16
    joints: int = 3
    degree: int | None = None

    def __post_init__(self) -> None:
        limits = {"pieces": (1, MAX_PIECES), "joints": (1, MAX_JOINTS), "degree": (2, MAX_DEGREE)}
        for name, (lower, upper) in limits.items():
            value = self.power if name == "degree" else getattr(self, name)
            if not isinstance(value, int) or not lower <= value <= upper:
                raise ConfigError(f"{name} must be between {lower} and {upper}, got {value}")
        if self.power <= self.joints:
            raise ConfigError(
                f"degree must be above {self.joints} with joints C{self.joints}, got {self.power}"
            )
        if self.free < 1:
            raise ConfigError(
                f"the class must have at least {2 * self.joints + 3} ordinates per event, got "
                f"{self.count}; use more pieces or a higher degree"
            )
        if self.count > MAX_ORDINATES:
            raise ConfigError(
                f"the class may have at most {MAX_ORDINATES} ordinates per event, got "
                f"{self.count}; use fewer pieces, a lower degree or smoother joints"
            )

    @property
    def power(self) -> int:
        """Degree of the B-splines: ``degree``, or ``joints`` + 2 if that is None."""
        return self.joints + 2 if self.degree is None else self.degree

    @property
    def knots(self) -> FloatArray:
        """Knot vector of the B-spline of one event, scaled to the interval [0, 1].

        An event is the motion between two dwells. Both ends have ``degree + 1`` equal knots. Each
        inner joint between two pieces has a number of equal knots that gives the continuity Cᵏ with
        k = ``joints``: the degree minus ``joints``.
        """
        inner = np.repeat(np.arange(1.0, self.pieces) / self.pieces, self.power - self.joints)
        ends = self.power + 1
        return np.concatenate([np.zeros(ends), inner, np.ones(ends)])

    @property
    def count(self) -> int:
        """Number of B-spline ordinates (control values) of one event.

        An event is the motion between two dwells.
        """
        return (self.pieces - 1) * (self.power - self.joints) + self.power + 1

    @property
    def free(self) -> int:
        """Number of B-spline ordinates per event that a design can choose.

        The first and last ``joints`` + 1 ordinates of an event are fixed, because the law must
        continue the neighbouring dwells. An event is the motion between two dwells.
        """
        return self.count - 2 * (self.joints + 1)

    @property
    def words(self) -> str:
        """Description of the class of laws as text for tables.

        An example is ``B-splines of degree 5 in 16 pieces, C3 joints``.
        """
        if self.pieces == 1:
            return f"Bézier curves of degree {self.power}"
        return f"B-splines of degree {self.power} in {self.pieces} pieces, C{self.joints} joints"


#: Largest number of start laws of a multistart search (local searches from several laws).
MAX_STARTS = 1000
#: Default number of start laws of a multistart search.
DEFAULT_STARTS = 8
#: Largest relative difference between the goals of two local searches at which they count as the
#: same result.
MULTISTART_RTOL = 1e-3


@dataclass(frozen=True)
class Multistart:
    """Options and outcome of local searches from several start laws.

    ``starts`` is the number of searches and ``seed`` the seed of the random start laws.
    ``starts_agreeing`` is the number of searches whose goal is within 0.1 % of the best. It is 0
    before the search has run.
    """

    starts: int = DEFAULT_STARTS
    seed: int = 1
    starts_agreeing: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.starts <= MAX_STARTS:
            raise ConfigError(f"starts must be between 1 and {MAX_STARTS}, got {self.starts}")
        if self.seed < 0:
            raise ConfigError(f"seed must be 0 or above, got {self.seed}")

    @property
    def words(self) -> str:
        """Description of the local searches and their outcome as text for tables.

        An example is ``local (8 starts, 5 ended within 0.1 % of the best)``.
        """
        starts = "1 start" if self.starts == 1 else f"{self.starts} starts"
        return f"local ({starts}, {self.starts_agreeing} ended within 0.1 % of the best)"


#: Allowed sets of properties that a designed law takes over from the start law: the spans of the
#: events (motions between two dwells), the dwells and the lift (default), the dwells and the lift,
#: or only the lift.
KEEP = (("events", "dwells", "lift"), ("dwells", "lift"), ("lift",))


def _parse_keep(keep: Sequence[str], limits: Sequence[Limit]) -> tuple[str, ...]:
    """Check ``keep``, and return the matching entry of `KEEP`.

    ``keep`` contains the properties of the start law that the design keeps, in any order. A limit
    on the span of an event conflicts with kept events and raises a `ConfigError`. An event is the
    motion between two dwells.
    """
    matches = [parts for parts in KEEP if set(parts) == {word.strip() for word in keep}]
    if not matches:
        allowed = " or ".join(",".join(parts) for parts in KEEP)
        raise ConfigError(f"keep must be {allowed}, got {','.join(keep)!r}")
    if "events" in matches[0] and any(x.term.quantity.where == "event" for x in limits):
        raise ConfigError(
            "a limit on event_angle requires free events; use --keep dwells,lift or --keep lift"
        )
    return matches[0]


def parse_goal(text: str) -> Term:
    """Parse the goal of a design, such as ``peak_jerk`` or ``shaft_torque@300rpm``.

    Raises
    ------
    ConfigError
        If the quantity is unknown, or only allowed as a limit.
    """
    term = parse_term(text, DESIGN_QUANTITIES)
    if not term.quantity.goal:
        goals = [name for name, quantity in DESIGN_QUANTITIES.items() if quantity.goal]
        raise ConfigError(f"the goal must be one of {', '.join(goals)}, got {term.name}")
    return term


def parse_second(text: str) -> Term:
    """Parse the second quantity of a Pareto front, over which the goal is plotted.

    It must be a quantity that can be a goal, or the span of an event. An event is the motion
    between two dwells.
    """
    term = parse_term(text, DESIGN_QUANTITIES)
    return term if term.quantity.where == "event" else parse_goal(text)


@dataclass(frozen=True)
class DesignRequest:
    """Request of a design: goal, limits, class of laws and search options.

    ``sense`` is ``<=`` to minimise the goal and ``>=`` to maximise it. ``keep`` names the
    properties that are taken over from the start law (see `KEEP`).
    """

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
        """Create a request from the texts of its goal and limits.

        Parameters
        ----------
        minimise, maximise : str, optional
            Quantity to minimise or to maximise. Exactly one of the two is required.
        limits : sequence of str, optional
            Limits such as ``"peak_acceleration<=start"``.
        law_class : LawClass, optional
            Class of laws to search (default: ``LawClass()``).
        multistart : Multistart, optional
            Options of a local search (default: ``Multistart()``).
        keep : sequence of str, optional
            Properties of the start law to keep: an entry of `KEEP` (default: all of them).

        Raises
        ------
        ConfigError
            If a text is invalid, or the goal or a limit is not possible in that sense or class.
        """
        if (minimise is None) == (maximise is None):
            raise ConfigError("exactly one goal is required, to minimise or to maximise")
        goal = parse_goal(minimise or maximise or "")
        sense: Sense = "<=" if minimise is not None else ">="
        if sense not in goal.quantity.senses:
            other = "maximise" if sense == "<=" else "minimise"
            raise ConfigError(f"goal {goal.key}: use {other}, because the opposite is not convex")
        limits_parsed = tuple(parse_limit(text, DESIGN_QUANTITIES) for text in limits)
        own_class, kept_parts = law_class or LawClass(), _parse_keep(keep, limits_parsed)
        for term in (goal, *(limit.term for limit in limits_parsed)):
            order = term.quantity.order
            if own_class.joints < order - 1:
                raise ConfigError(
                    f"{term.key} requires joints C{order - 1} or above, got C{own_class.joints}, "
                    "with which a lower derivative may have steps"
                )
        return cls(goal, sense, limits_parsed, own_class, multistart or Multistart(), kept_parts)

    @classmethod
    def of_config(cls, config: DesignConfig) -> DesignRequest:
        """Create a request from the content of a design file."""
        config_class = config.class_
        if not (config_class.joints[:1] in ("C", "c") and config_class.joints[1:].isdecimal()):
            raise ConfigError(f"joints must be C1 to C{MAX_JOINTS}, got {config_class.joints!r}")
        law_class = LawClass(config_class.pieces, int(config_class.joints[1:]), config_class.degree)
        search = Multistart(config.starts, config.seed)
        fields = config.model_dump(include={"minimise", "maximise", "limits", "keep"})
        return cls.of(law_class=law_class, multistart=search, **fields)

    @property
    def verb(self) -> str:
        """Verb that states the goal of a design: ``minimise`` or ``maximise``."""
        return "minimise" if self.sense == "<=" else "maximise"

    @property
    def words(self) -> str:
        """Description of the goal for titles, such as ``minimise peak acceleration``."""
        return f"{self.verb} {self.goal.words}"
