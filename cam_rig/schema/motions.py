"""Segments of tasks and of the handbooks' rises, with the levels and ends of segments."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import Discriminator, Field, Tag, model_validator

from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.schema.segment_base import SegmentBase
from cam_rig.schema.tuned import Shaping, Tuning

#: Fraction of the lift, a plain number.
Fraction = Annotated[float, Field(ge=-1.0, le=1.0, allow_inf_nan=False, strict=True)]
#: Level at which a segment ends: a fraction of the lift, or a length.
Level = Annotated[
    Annotated[Fraction, Tag("fraction")]
    | Annotated[Quantity, must_be("length", ge=-100.0, le=100.0), Tag("lift")],
    Discriminator(lambda value: "fraction" if isinstance(value, int | float) else "lift"),
]


def level_m(level: Quantity | float, lift: float) -> float:
    """Return a level of `Level` in m. ``lift`` is the lift of the cam, m."""
    return level.si if isinstance(level, Quantity) else level * lift


class LevelSegment(SegmentBase):
    """Base class of segments that end at a level.

    `to` is a fraction of the lift, or a length.
    """

    to: Level


#: Smallest and largest derivative of the lift, SI units.
_LIMITS: dict[str, float] = {"ge": -1e6, "le": 1e6}
#: Velocity s', acceleration s'' and jerk s''', of either sign.
Velocity = Annotated[Quantity, must_be("velocity over angle", **_LIMITS)]
Acceleration = Annotated[Quantity, must_be("acceleration over angle", **_LIMITS)]
Jerk = Annotated[Quantity, must_be("jerk over angle", **_LIMITS)]


class SegmentEnd(Strict):
    """Derivatives of the lift by the cam angle at an end of a segment.

    A missing derivative is that of the neighbour.
    """

    velocity: Velocity | None = None
    acceleration: Acceleration | None = None
    jerk: Jerk | None = None


MotionName = Literal["poly5", "poly7", "harmonic_combination", "sine_line_combination"]
#: Names of the motions between any ends.
MOTIONS: tuple[str, ...] = get_args(MotionName)


class JoiningMotion(LevelSegment):
    """Motion between any ends, which are those of the neighbours if they are not given.

    Parameters
    ----------
    law : str
        ``poly5``, ``poly7`` (also with the jerk of its ends), ``harmonic_combination``, or
        ``sine_line_combination`` (without acceleration at its ends).
    start, end : SegmentEnd or None
        Derivatives at the ends (default: those of the neighbours).
    """

    law: MotionName
    start: SegmentEnd | None = None
    end: SegmentEnd | None = None

    @model_validator(mode="after")
    def _check_jerk(self) -> JoiningMotion:
        for side, end in (("start", self.start), ("end", self.end)):
            if end is not None and end.jerk is not None and self.law != "poly7":
                raise ValueError(f"{side}.jerk: is {end.jerk}; allowed: for poly7 only")
        return self


class Polydyne(Tuning, LevelSegment):
    """Rise after which the mass on the stem of a rig rests, at one speed.

    Parameters
    ----------
    follower : str
        Name of the rise that the mass makes at the speed, of class C2 or smoother.
    """

    law: Literal["polydyne"]
    follower: str = Field(min_length=1)


class _Handbook(LevelSegment):
    """Base class of the handbooks' rises.

    With `mirrored` the rise is mirrored in time: it starts as it would otherwise end. `shaping`
    shapes the rise for the stem of a rig.
    """

    mirrored: bool = Field(default=False, strict=True)
    shaping: Shaping | None = None

    @property
    def parameters(self) -> dict[str, float | None]:
        """Parameters of the family by name."""
        return {}


class HandbookRise(_Handbook):
    """Rise of the handbooks without parameters."""

    law: Literal[
        "double_harmonic",
        "gutman13",
        "freudenstein13",
        "freudenstein135",
        "poly8",
        "low_impact_crossover",
    ]


#: Shares b, c and d of sine, constant and cosine acceleration, by the name of the law.
SCCA_SHARES = {
    "scca": (0.25, 0.5, 0.25),
    "modified_constant_velocity": (0.25, 0.0, 0.75),
    "parabolic": (0.0, 1.0, 0.0),
}
#: Names of the parameters of the family.
SCCA_PARAMETERS = ("b", "c", "d", "constant_velocity", "acceleration_share")
#: Share of the span with constant velocity of the law ``modified_constant_velocity``.
CONSTANT_VELOCITY = 0.5
#: Smallest share that is not zero. The jerk of a shorter part is no longer a cam's.
MIN_SHARE = 1e-3
#: Largest share of the span with constant velocity.
MAX_CONSTANT_VELOCITY = 0.95
#: Smallest and largest share of acceleration. The handbooks draw curves from 0.2 to 0.8.
ACCELERATION_SHARES = (0.1, 0.9)
Share = Annotated[Quantity, must_be("ratio", ge=0.0, le=1.0)]


class SccaRise(_Handbook):
    """Rise with sine, constant and cosine acceleration, and with constant velocity.

    Parameters
    ----------
    b, c, d : Quantity or None
        Shares of sine, constant and cosine in the time with acceleration or deceleration. Their
        sum is 1 (default: those of the law, `SCCA_SHARES`).
    constant_velocity : Quantity or None
        Share of the span with constant velocity (default: 0, or 0.5 for the law
        ``modified_constant_velocity``).
    acceleration_share : Quantity or None
        Share of acceleration in the time with acceleration or deceleration (default: 0.5).
    """

    law: Literal["scca", "modified_constant_velocity", "parabolic"]
    b: Share | None = None
    c: Share | None = None
    d: Share | None = None
    constant_velocity: Share | None = None
    acceleration_share: Share | None = None

    @property
    def parameters(self) -> dict[str, float | None]:
        """Parameters of the family by name, None for the default of the law."""
        numbers = {name: getattr(self, name) for name in SCCA_PARAMETERS}
        return {name: None if number is None else number.si for name, number in numbers.items()}

    @model_validator(mode="after")
    def _check_shares(self) -> SccaRise:
        values = {name: x for name, x in self.parameters.items() if x is not None}
        shares = dict(zip("bcd", SCCA_SHARES[self.law], strict=True))
        shares |= {name: x for name, x in values.items() if name in shares}
        if abs(sum(shares.values()) - 1.0) > 1e-9:
            text = ", ".join(f"{share:g}" for share in shares.values())
            total = sum(shares.values())
            raise ValueError(
                f"b, c, d: are {text} with the sum {total:.9g}; allowed: a sum of 1, so give all "
                "three"
            )
        limits = {"constant_velocity": (0.0, MAX_CONSTANT_VELOCITY)}
        limits |= {"acceleration_share": ACCELERATION_SHARES}
        for name, value in values.items():
            low, high = limits.get(name, (0.0, 1.0))
            if not low <= value <= high:
                raise ValueError(f"{name}: is {value:g}; allowed: {low:g} to {high:g}")
            if 0.0 < value < MIN_SHARE:
                raise ValueError(f"{name}: is {value:g}; allowed: 0, or at least {MIN_SHARE:g}")
        return self
