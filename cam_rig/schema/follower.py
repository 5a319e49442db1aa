"""The follower of a cam file: its kind, its size, and the size of the cam under it.

Lengths of the cam's plane are in the frame of the follower's guide: the cam's axis is the origin,
a translating follower moves along +y, an oscillating one has its pivot on +x. With an
oscillating follower the law is the way along the arc at the end of ``arm``: its angle is
s / arm, in rad.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from cam_rig.schema.quantity import Quantity, Strict, must_be

Length = Annotated[Quantity, must_be("length", above=0.0, most=100.0)]
Offset = Annotated[Quantity, must_be("length", least=-100.0, most=100.0)]
#: A face is inclined by less than a right angle.
Inclination = Annotated[Quantity, must_be("angle", least=-1.5, most=1.5)]
Steepest = Annotated[Quantity, must_be("angle", above=0.0, most=0.5 * math.pi)]
#: Between two arms of one rocker.
ArmsAngle = Annotated[Quantity, must_be("angle", above=0.0, most=2.0 * math.pi)]
Radius = Annotated[Quantity, must_be("length", least=0.0, most=100.0)]


class _Follower(Strict):
    """What every follower has.

    ``least_curvature_radius`` (0 when not given) is what contact stress asks of convex parts,
    ``most_pressure_angle`` what the guide or the pivot bears: 30° and 45° when not given.
    """

    base_radius: Length
    least_curvature_radius: Radius | None = None
    most_pressure_angle: Steepest | None = None

    @property
    def roller(self) -> float:
        """Roller radius in m, 0 for a follower without one."""
        return 0.0

    @property
    def sprung(self) -> bool:
        """Whether a spring alone holds it on the cam, as the dynamic models take it."""
        return True

    def numbers(self) -> dict[str, Quantity]:
        """Every number of the follower by its key."""
        fields = ((key, getattr(self, key)) for key in type(self).model_fields)
        return {key: value for key, value in fields if isinstance(value, Quantity)}


class _Rolling(_Follower):
    roller_radius: Length

    @property
    def roller(self) -> float:
        """Roller radius in m."""
        return self.roller_radius.si


class _Guided(_Follower):
    """Its guide runs past the cam's axis at ``eccentricity``, towards +x."""

    eccentricity: Offset | None = None


class _Pivoted(_Follower):
    """Swings about a pivot at ``pivot_distance`` from the cam's axis; the law is at ``arm``.

    A rig's numbers are those at the arm's end, along its arc: mass J/arm², stiffness and damping
    of the arm over arm², moments over arm. Then J φ'' = M is m s'' = F with s = arm φ, exactly.
    """

    pivot_distance: Length
    arm: Length


class _Positive(_Follower):
    """The cam moves it both ways."""

    @property
    def sprung(self) -> bool:
        """No: it cannot leave the cam."""
        return False


class Point(_Guided):
    """A knife edge in a guide."""

    type: Literal["point"]


class Roller(_Guided, _Rolling):
    """A roller in a guide."""

    type: Literal["roller"]


class Flat(_Guided):
    """A face square to its guide."""

    type: Literal["flat"]


class InclinedFlat(_Guided):
    """A face turned by ``inclination``, counterclockwise from square to its guide."""

    type: Literal["inclined_flat"]
    inclination: Inclination


class OscillatingPoint(_Pivoted):
    """A knife edge at the end of an arm."""

    type: Literal["oscillating_point"]


class OscillatingRoller(_Pivoted, _Rolling):
    """A roller at the end of an arm."""

    type: Literal["oscillating_roller"]


class OscillatingFlat(_Pivoted):
    """A face along an arm, ``face_offset`` from the pivot away from the cam (0: through it)."""

    type: Literal["oscillating_flat"]
    face_offset: Offset | None = None


class ConstantBreadth(_Positive):
    """A frame of two parallel faces around one cam."""

    type: Literal["constant_breadth"]


class ConstantDiameter(_Positive, _Rolling):
    """A frame of two rollers, opposite each other on one cam."""

    type: Literal["constant_diameter"]


class Conjugate(_Positive, _Guided, _Rolling):
    """A frame of two rollers, each on its own cam of one shaft.

    ``roller_distance`` is that of the two axes, 2 (R_b + R_r) + s_max when not given: then both
    cams have one prime circle.
    """

    type: Literal["conjugate"]
    roller_distance: Length | None = None


class OscillatingConjugate(_Positive, _Pivoted, _Rolling):
    """Two arms about one pivot, a roller at the end of each on its own cam of one shaft.

    The second arm is as long as the first, on the other side of the cam's axis, and turns with it:
    ``arms_angle`` is between them, 2 γ + s_max / arm when not given: then both cams have one prime
    circle. γ is the first arm's angle at the pivot at no lift.
    """

    type: Literal["oscillating_conjugate"]
    arms_angle: ArmsAngle | None = None


Translating = Point | Roller | Flat | InclinedFlat
Oscillating = OscillatingPoint | OscillatingRoller | OscillatingFlat
Desmodromic = ConstantBreadth | ConstantDiameter | Conjugate | OscillatingConjugate

Follower = Annotated[Translating | Oscillating | Desmodromic, Field(discriminator="type")]
