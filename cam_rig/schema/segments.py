"""Segments of a cam: named rises, curves by ordinates or conditions, arcs."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from typing import Annotated, Any, Literal, get_args

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticKnownError

from cam_rig.errors import did_you_mean
from cam_rig.schema import motions
from cam_rig.schema.law_names import law_name, suggest_law
from cam_rig.schema.quantity import MANY, Quantity, Strict, must_be
from cam_rig.schema.segment_base import Length, Ratios, SegmentBase, Span, Table, WholeTurn
from cam_rig.schema.tuned import Shaping
from cam_rig.units import TURN

#: Largest number of ordinates of a Bézier curve. Degree 100 is far beyond any cam, and stable.
MAX_ORDINATES = 101
#: Largest number of conditions of a polynomial. A polynomial of more conditions would oscillate
#: between them.
MAX_CONDITIONS = 21
#: Largest number of harmonics of a trigonometric law.
MAX_HARMONICS = 50
#: Largest degree of a B-spline.
MAX_B_SPLINE_DEGREE = 15
#: Largest number of ordinates of a B-spline.
MAX_B_SPLINE_ORDINATES = 500
#: Cam angles of conditions, up to one turn.
Angles = Annotated[Quantity, must_be("angle", counts=(1, MANY), ge=0.0, le=TURN + 1e-12)]
#: Amplitudes of the harmonics of a trigonometric law, as fractions of the lift.
Harmonics = Annotated[Quantity, must_be("ratio", counts=(1, MAX_HARMONICS), ge=-100.0, le=100.0)]
#: Order of the derivative that a condition of a polynomial prescribes, 0 for the lift.
Order = Annotated[int, Field(ge=0, lt=MAX_CONDITIONS, strict=True)]


class Bezier(SegmentBase):
    """Bézier curve by its ordinates, as fractions of the lift.

    The first and the last ordinate are the levels of the ends.
    """

    law: Literal["bezier"]
    ordinates: Annotated[Quantity, must_be("ratio", counts=(2, MAX_ORDINATES), ge=-100.0, le=100.0)]


class BSpline(SegmentBase):
    """B-spline by degree, knots and ordinates (profile thesis §2.1.2).

    The knots are scaled to the span. The ordinates are fractions of the lift. The first and the
    last knot are repeated `degree` times, so that the curve starts at the first ordinate and ends
    at the last. L pieces of degree n have L + n ordinates and L + 2n − 1 knots.
    """

    law: Literal["b_spline"]
    degree: int = Field(ge=1, le=MAX_B_SPLINE_DEGREE, strict=True)
    knots: Annotated[Quantity, must_be("ratio", counts=(1, MANY))]
    ordinates: Ratios

    @model_validator(mode="after")
    def _check_counts(self) -> BSpline:
        knots, count = self.knots.numbers, len(self.ordinates.numbers)
        if not self.degree + 1 <= count <= MAX_B_SPLINE_ORDINATES:
            raise ValueError(
                f"ordinates: are {count}; allowed for degree {self.degree}: "
                f"{self.degree + 1} to {MAX_B_SPLINE_ORDINATES}"
            )
        if len(knots) != count + self.degree - 1:
            raise ValueError(
                f"knots: are {len(knots)}; allowed for {count} ordinates of degree "
                f"{self.degree}: {count + self.degree - 1}, the ends counted {self.degree} times"
            )
        for i, (before, after) in enumerate(pairwise(knots)):
            if after < before:
                text = f"knot {i + 2} is {after:g} after {before:g}"
                raise ValueError(f"knots: {text}; allowed: rising")
        for knot, times in Counter(knots).items():
            is_end = knot in (knots[0], knots[-1])
            if (is_end and times != self.degree) or times > self.degree:
                limit = f"{self.degree} times" if is_end else f"at most {self.degree} times"
                raise ValueError(f"knots: {knot:g} occurs {times} times; allowed: {limit}")
        return self


class Trigonometric(WholeTurn):
    """Trigonometric polynomial c₀ + Σ cᵢ cos iθ + sᵢ sin iθ of a whole turn (eq. 2.2).

    `mean` is c₀, `cosine` and `sine` are cᵢ and sᵢ from i = 1 on. All are fractions of the lift.
    """

    law: Literal["trigonometric"]
    mean: Annotated[Quantity, must_be("ratio", ge=-100.0, le=100.0)]
    cosine: Harmonics | None = None
    sine: Harmonics | None = None


class Polynomial(SegmentBase):
    """Polynomial of the lowest degree that satisfies conditions.

    Parameters
    ----------
    at : Quantity
        Cam angle of each condition from the start of the segment, rad.
    order : list of int
        Order r of the derivative of each condition.
    value : Quantity
        Value of each condition: for order 0 a fraction of the lift, for order r in lift/span^r.
    """

    law: Literal["polynomial"]
    at: Angles
    order: list[Order]
    value: Annotated[Quantity, must_be("ratio", counts=(1, MANY), ge=-1e6, le=1e6)]

    @model_validator(mode="after")
    def _check_conditions(self) -> Polynomial:
        counts = {len(self.at.numbers), len(self.order), len(self.value.numbers)}
        if len(counts) != 1:
            raise ValueError(
                f"at, order, value: are {len(self.at.numbers)}, {len(self.order)} and "
                f"{len(self.value.numbers)} numbers; allowed: one of each for a condition"
            )
        count = len(self.order)
        if not 1 <= count <= MAX_CONDITIONS:
            raise ValueError(f"at: {count} conditions; allowed: 1 to {MAX_CONDITIONS}")
        for angle, order in zip(self.at.si_list, self.order, strict=True):
            if angle > self.span.si * (1.0 + 1e-12):
                raise ValueError(
                    f"at: is {math.degrees(angle):g}°; allowed: within the span, "
                    f"{math.degrees(self.span.si):g}°"
                )
            if order >= count:
                raise ValueError(
                    f"order: is {order}; allowed: at most {count - 1}, the degree that "
                    f"{count} conditions give"
                )
        for (angle, order), times in Counter(zip(self.at.numbers, self.order, strict=True)).items():
            if times > 1:
                raise ValueError(
                    f"at: has {angle:g} {self.at.unit} of order {order} twice; allowed: once"
                )
        return self


#: Largest number of parts of a contour.
MAX_ARCS = 100
#: Length with a sign: a coordinate, or a radius that is negative for concave arcs.
SignedLength = Annotated[Quantity, must_be("length", ge=-100.0, le=100.0)]


class TangentArcs(SegmentBase):
    """Event of a cam of arcs with concave flanks, by its angles.

    `span` (rad) is the angle of the event, from the base circle over the nose and back. `nose_span`
    (rad) is the angle of the nose's arc on the pitch curve.
    """

    law: Literal["tangent_arcs"]
    nose_span: Span


class ArcsByRadii(WholeTurn):
    """Contour of base circle, two equal flanks and a nose, by their radii (m).

    The base circle is that of the follower. The top of the nose is one lift above it, at 180°. The
    angles of the event follow from the radii. A straight flank is without radius.
    """

    law: Literal["arcs_by_radii"]
    flank: Literal["convex", "straight", "concave"]
    flank_radius: Length | None = None
    nose_radius: Length

    @model_validator(mode="after")
    def _check_flank(self) -> ArcsByRadii:
        if (self.flank == "straight") != (self.flank_radius is None):
            need = "has no" if self.flank == "straight" else "needs"
            raise ValueError(f"flank: {self.flank} {need} flank_radius")
        return self


class ArcSpec(Strict):
    """Part of a contour: an arc or a line.

    - With `radius`, `x` and `y` (m): an arc about the centre (x, y).
    - With `radius` only: the arc of this radius that joins its neighbours.
    - Without numbers: the line that joins its neighbours.

    The radius of a concave arc is negative.
    """

    radius: SignedLength | None = None
    x: SignedLength | None = None
    y: SignedLength | None = None

    @model_validator(mode="after")
    def _check_keys(self) -> ArcSpec:
        centre = [key for key in ("x", "y") if getattr(self, key) is not None]
        if len(centre) == 1 or (centre and self.radius is None):
            keys = ", ".join([*centre, *([] if self.radius is None else ["radius"])])
            raise ValueError(f"has {keys}; allowed: radius, x and y, or radius alone, or nothing")
        if self.radius is not None and self.radius.si == 0.0:
            raise ValueError("radius: is 0; allowed: positive (convex) or negative (concave)")
        return self


class ArcsByCentres(WholeTurn):
    """Contour of arcs by centres and radii.

    The arcs are in the order of the cam angle, from +y towards +x. Their centres are in the cam's
    frame. At cam angle 0 the follower is above the cam, on +y.
    """

    law: Literal["arcs_by_centres"]
    arcs: list[ArcSpec] = Field(min_length=2, max_length=MAX_ARCS)


_Classical = Literal[
    "constant_velocity", "simple_harmonic", "cycloidal", "modified_sine", "modified_trapezoid"
]
_Polynomial = Literal["poly345", "poly4567", "bezier5", "bezier7", "bezier9"]
_HalfRise = Literal[
    "bezier4_start", "bezier6_start", "bezier8_start", "bezier4_end", "bezier6_end", "bezier8_end"
]
#: Names of rises.
RiseName = Literal[_Classical, _Polynomial, _HalfRise]


class Dwell(SegmentBase):
    """Dwell at the level of the end of the segment before it."""

    law: Literal["dwell"]


class Rise(SegmentBase):
    """Rise or fall from the level of the segment before it to `to`.

    `to` is a fraction of the lift, or a length. A segment of constant velocity may have the
    velocity (m/rad) instead. `shaping` shapes the rise for the stem of a rig. The half-rises
    ``…_start`` lead from rest to a constant velocity, and ``…_end`` back to rest. A
    ``constant_velocity`` segment of the same slope fits between them.
    """

    law: RiseName
    shaping: Shaping | None = None
    velocity: motions.Velocity | None = None
    to: motions.Level | None = Field(default=None, validate_default=True)

    @field_validator("to", mode="before")
    @classmethod
    def _check_to(cls, value: Any, info: ValidationInfo) -> Any:
        if value is None and "velocity" in info.data and info.data["velocity"] is None:
            raise PydanticKnownError("missing")
        return value

    @model_validator(mode="after")
    def _check_velocity(self) -> Rise:
        if self.velocity and (self.law != "constant_velocity" or self.to is not None):
            raise ValueError(
                f"velocity: is {self.velocity}; allowed: only for the law constant_velocity, and "
                "without the key to"
            )
        return self


#: Model of each segment of a cam, which the key ``law`` selects.
_Models = (
    Dwell
    | Rise
    | motions.JoiningMotion
    | motions.Polydyne
    | motions.SccaRise
    | motions.HandbookRise
    | Bezier
    | BSpline
    | Polynomial
    | Trigonometric
    | TangentArcs
    | ArcsByRadii
    | ArcsByCentres
    | Table
)
#: Names of laws in files.
SEGMENT_LAWS = [
    name for kind in get_args(_Models) for name in get_args(kind.model_fields["law"].annotation)
]


#: Tasks that are laws themselves. Another task follows from the ends of a law.
TASKS = ("dwell", "constant_velocity")


def _use_law_name(value: Any) -> Any:
    """Replace a task or another name of a law in the data of a segment.

    ``{task: dwell}`` becomes ``{law: dwell}``, and a name of another program or handbook becomes
    that of cam_rig, such as "Bestehorn" cycloidal.
    """
    if isinstance(value, dict) and "task" in value:
        task, others = value["task"], {key: x for key, x in value.items() if key != "task"}
        if "law" in value or task not in TASKS:
            raise ValueError(
                f"task: is {task!r:.40}; allowed: {' or '.join(TASKS)}, without the key law"
            )
        return {"law": task, **others}
    if not isinstance(value, dict) or not isinstance(name := value.get("law"), str):
        return value
    law = law_name(name)
    is_known = law in SEGMENT_LAWS or did_you_mean(name, SEGMENT_LAWS)
    if not is_known and (hint := suggest_law(name, SEGMENT_LAWS)):
        raise ValueError(f"law: is {name[:40]!r}{hint}; allowed: a name of cam-rig laws")
    return {**value, "law": law if law in SEGMENT_LAWS else name}


#: Segment of a cam: one model per law. The key ``law`` selects the model.
Segment = Annotated[_Models, Field(discriminator="law"), BeforeValidator(_use_law_name)]
