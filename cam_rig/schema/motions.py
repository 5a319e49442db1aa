"""Segments of the handbooks' rises, with the levels at which segments end."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from cam_rig.schema.quantity import Quantity, must_be
from cam_rig.schema.segment_base import SegmentBase

#: Fraction of the lift, a plain number.
Fraction = Annotated[float, Field(ge=-1.0, le=1.0, allow_inf_nan=False, strict=True)]
#: Lift with a sign.
Lift = Annotated[Quantity, must_be("length", ge=-100.0, le=100.0)]


def _level_kind(value: object) -> str:
    """Return the alternative of `Level` that a value belongs to."""
    return "fraction" if isinstance(value, int | float) else "lift"


#: Level at which a segment ends: a fraction of the lift, or a length.
Level = Annotated[
    Annotated[Fraction, Tag("fraction")] | Annotated[Lift, Tag("lift")],
    Discriminator(_level_kind),
]


class LevelSegment(SegmentBase):
    """Base class of segments that end at a level.

    `to` is a fraction of the lift, or a length.
    """

    to: Level

    def end_level(self, lift: float) -> float:
        """Return the level of the end in m. ``lift`` is that of the cam, m."""
        return self.to.si if isinstance(self.to, Quantity) else self.to * lift


class _Handbook(LevelSegment):
    """Base class of the handbooks' rises.

    With `mirrored` the rise is mirrored in time: it starts as it would otherwise end.
    """

    mirrored: bool = Field(default=False, strict=True)

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
            raise ValueError(f"b, c, d: are {text}; allowed: a sum of 1, so give all three")
        limits = {"constant_velocity": (0.0, MAX_CONSTANT_VELOCITY)}
        limits |= {"acceleration_share": ACCELERATION_SHARES}
        for name, value in values.items():
            low, high = limits.get(name, (0.0, 1.0))
            if not low <= value <= high:
                raise ValueError(f"{name}: is {value:g}; allowed: {low:g} to {high:g}")
            if 0.0 < value < MIN_SHARE:
                raise ValueError(f"{name}: is {value:g}; allowed: 0, or at least {MIN_SHARE:g}")
        return self
