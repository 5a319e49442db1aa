"""Cam files: the law as segments of one turn, the follower, and the contact."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from cam_rig.schema.named import NamedConfig
from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.schema.segment_base import SegmentBase, Table, iterate_quantities
from cam_rig.schema.segments import Segment

Width = Annotated[Quantity, must_be("length", gt=0.0, ge=1e-6, le=10.0)]
Modulus = Annotated[Quantity, must_be("pressure", gt=0.0, ge=1e6, le=1e13)]
#: Poisson ratio. The largest value, 0.5, is that of an incompressible solid.
Poisson = Annotated[Quantity, must_be("ratio", ge=0.0, le=0.5)]
Pressure = Annotated[Quantity, must_be("pressure", gt=0.0, le=1e13)]
Sliding = Annotated[Quantity, must_be("linear speed", gt=0.0, le=1e4)]


def _assumed(value: float, unit: str, source: str) -> Quantity:
    return Quantity(assumed=value, unit=unit, source=source)


class ContactParts(Strict):
    """Section ``contact`` of a cam file. Every key has a default.

    Parameters
    ----------
    face_width : Quantity
        Width of the line contact, m.
    tip_radius : Quantity
        Radius of the tip of a point follower, m. An ideal point would have infinite pressure.
    youngs_modulus, poisson_ratio : Quantity
        Young's modulus (Pa) and Poisson ratio of the cam.
    follower_youngs_modulus, follower_poisson_ratio : Quantity or None
        Young's modulus (Pa) and Poisson ratio of the follower (default: those of the cam).
    most_pressure : Quantity
        Permissible Hertzian pressure, Pa. It bounds the base radius from below.
    most_sliding_speed : Quantity
        Permissible sliding speed, m/s. It bounds the base radius from above.
    """

    face_width: Width = _assumed(10.0, "mm", "no source prints it; a narrow cam of a test rig")
    tip_radius: Width = _assumed(1.0, "mm", "no source prints it; a rounded knife edge")
    youngs_modulus: Modulus = _assumed(206.0, "GPa", "steel; no source prints the material")
    poisson_ratio: Poisson = _assumed(0.3, "1", "steel")
    follower_youngs_modulus: Modulus | None = None
    follower_poisson_ratio: Poisson | None = None
    most_pressure: Pressure = _assumed(
        1000.0, "MPa", "free choice: hardened steel; the sources print no permissible pressure"
    )
    most_sliding_speed: Sliding = _assumed(
        2.0, "m/s", "free choice: the sources print no permissible sliding speed"
    )

    @property
    def modulus(self) -> float:
        """Contact modulus E* (Pa) of the pair: 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂."""
        cam = (1.0 - self.poisson_ratio.si**2) / self.youngs_modulus.si
        poisson = self.follower_poisson_ratio or self.poisson_ratio
        young = self.follower_youngs_modulus or self.youngs_modulus
        return 1.0 / (cam + (1.0 - poisson.si**2) / young.si)


Length = Annotated[Quantity, must_be("length", gt=0.0, le=100.0)]
Offset = Annotated[Quantity, must_be("length", ge=-100.0, le=100.0)]
#: Inclination of a flat face, rad. The limits are a little less than a right angle.
Inclination = Annotated[Quantity, must_be("angle", ge=-1.5, le=1.5)]
#: Largest permissible pressure angle, up to a right angle.
MaxPressureAngle = Annotated[Quantity, must_be("angle", gt=0.0, le=0.5 * math.pi)]
#: Angle between the two arms of an oscillating conjugate follower, rad.
ArmsAngle = Annotated[Quantity, must_be("angle", gt=0.0, le=2.0 * math.pi)]
Radius = Annotated[Quantity, must_be("length", ge=0.0, le=100.0)]


class BaseFollower(Strict):
    """Base class of the followers.

    Parameters
    ----------
    base_radius : Quantity
        Radius of the base circle, m.
    least_curvature_radius : Quantity or None
        Smallest permissible radius of convex parts, for the contact stress, m (default: 0).
    most_pressure_angle : Quantity or None
        Largest permissible pressure angle, rad (default: 30° in a guide, 45° on a pivot).
    """

    #: True if only a spring keeps the follower on the cam, as the dynamic models assume.
    sprung: ClassVar[bool] = True

    base_radius: Length
    least_curvature_radius: Radius | None = None
    most_pressure_angle: MaxPressureAngle | None = None

    @property
    def roller(self) -> float:
        """Roller radius in m, 0 for a follower without a roller."""
        return 0.0


class _Rolling(BaseFollower):
    """Follower with a roller of `roller_radius` (m)."""

    roller_radius: Length

    @property
    def roller(self) -> float:
        """Roller radius in m."""
        return self.roller_radius.si


class _Guided(BaseFollower):
    """Follower in a guide that passes the cam's axis at `eccentricity` (m, to +x)."""

    eccentricity: Offset | None = None


class _Pivoted(BaseFollower):
    """Follower on a pivot at `pivot_distance` (m) from the cam's axis.

    The law is the displacement s = arm φ of the end of the arm of length `arm` (m), along its arc.
    The numbers of a rig apply to this point: mass J/arm², rotational stiffness and damping divided
    by arm², moments divided by arm. Then J φ'' = M and m s'' = F are equivalent.
    """

    pivot_distance: Length
    arm: Length


class _Positive(BaseFollower):
    """Follower that the cam moves in both directions, so that it cannot leave the cam."""

    sprung: ClassVar[bool] = False


class Point(_Guided):
    """Knife edge in a guide."""

    type: Literal["point"]


class Roller(_Guided, _Rolling):
    """Roller in a guide."""

    type: Literal["roller"]


class Flat(_Guided):
    """Flat face perpendicular to its guide."""

    type: Literal["flat"]


class InclinedFlat(_Guided):
    """Flat face in a guide, turned by `inclination` (rad) from its perpendicular.

    A positive angle is counterclockwise.
    """

    type: Literal["inclined_flat"]
    inclination: Inclination


class OscillatingPoint(_Pivoted):
    """Knife edge at the end of an arm."""

    type: Literal["oscillating_point"]


class OscillatingRoller(_Pivoted, _Rolling):
    """Roller at the end of an arm."""

    type: Literal["oscillating_roller"]


class OscillatingFlat(_Pivoted):
    """Flat face along an arm.

    `face_offset` (m) is its distance from the pivot, away from the cam (default: 0, the face
    passes through the pivot).
    """

    type: Literal["oscillating_flat"]
    face_offset: Offset | None = None


class ConstantBreadth(_Positive):
    """Frame with two parallel faces around one cam."""

    type: Literal["constant_breadth"]


class ConstantDiameter(_Positive, _Rolling):
    """Frame with two rollers on opposite sides of one cam."""

    type: Literal["constant_diameter"]


class Conjugate(_Positive, _Guided, _Rolling):
    """Frame with two rollers, each on a separate cam of one shaft.

    `roller_distance` (m) is the distance of their axes. The default 2 (R_b + R_r) + s_max gives
    both cams the same prime circle.
    """

    type: Literal["conjugate"]
    roller_distance: Length | None = None


class OscillatingConjugate(_Positive, _Pivoted, _Rolling):
    """Two arms on one pivot with a roller each, on separate cams of one shaft.

    The arms have the same length and are on opposite sides of the cam's axis. `arms_angle` (rad)
    is the angle between them. The default 2 γ + s_max / arm gives both cams the same prime circle.
    γ is the angle of the first arm at zero lift.
    """

    type: Literal["oscillating_conjugate"]
    arms_angle: ArmsAngle | None = None


Translating = Point | Roller | Flat | InclinedFlat
Oscillating = OscillatingPoint | OscillatingRoller | OscillatingFlat
Desmodromic = ConstantBreadth | ConstantDiameter | Conjugate | OscillatingConjugate
Follower = Annotated[Translating | Oscillating | Desmodromic, Field(discriminator="type")]
#: Frames of the rig's robot model. In addition, each cam has a frame of its name.
FRAMES = ("base_link", "guide", "motor", "microphone", "cam", "follower", "follower_arc")


class CamConfig(NamedConfig):
    """Cam: a law as segments of one turn, and a follower.

    A file of ``config/cams/`` contains one cam.

    Parameters
    ----------
    name : str
        Name of the cam, and of its file: small letters, digits and _ (default: own_cam).
    title : str or None
        Title in figures and reports (default: the name).
    lift : float, str or Quantity
        Lift h in m, or a text with a unit.
    segments : sequence of mapping
        Segments in the order of the cam angle, as in a file: ``law``, ``span`` (rad, or a text
        with a unit) and the keys of the law. The sum of the spans is one turn.
    follower : mapping
        ``type`` and sizes of the follower, as in a file.
    contact : mapping or None
        Width, material and permissible values of the contact (default: see `parts`).
    identified_from : str or None
        Data from which the dimensions of the cam were identified.
    cannot_be_made : str or None
        Reason why the cam fails a check on purpose. Such a cam can only be displayed.

    Raises
    ------
    ConfigError
        If a value is missing, out of range, or of a wrong type.

    Examples
    --------
    >>> import cam_rig
    >>> cam = cam_rig.Cam(
    ...     "lug",
    ...     lift="20 mm",
    ...     segments=[
    ...         {"law": "poly345", "span": "120 deg", "to": 1.0},
    ...         {"law": "cycloidal", "span": "120 deg", "to": 0.0},
    ...         {"law": "dwell", "span": "120 deg"},
    ...     ],
    ...     follower={"type": "roller", "base_radius": 0.04, "roller_radius": "10 mm"},
    ... )
    >>> cam
    Cam('lug': lift 20 mm, roller, 3 segments)
    >>> round(cam_rig.build_law(cam.replace(lift="25 mm")).lift, 6)
    0.025
    """

    kind = "cam"

    identified_from: str | None = None
    cannot_be_made: str | None = Field(default=None, min_length=1)
    lift: Annotated[Quantity, must_be("length", gt=0.0, le=100.0)]
    follower: Follower
    contact: ContactParts | None = None
    segments: list[Segment] = Field(min_length=1)

    def __init__(
        self,
        name: str = "own_cam",
        title: str | None = None,
        *,
        lift: float | str | Quantity,
        segments: Sequence[SegmentBase | Mapping[str, object]],
        follower: BaseFollower | Mapping[str, object],
        contact: ContactParts | Mapping[str, object] | None = None,
        identified_from: str | None = None,
        cannot_be_made: str | None = None,
    ) -> None:
        sections = {"lift": lift, "segments": segments, "follower": follower, "contact": contact}
        notes = {"identified_from": identified_from, "cannot_be_made": cannot_be_made}
        super().__init__(name, title, **sections, **notes)

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]  # as in Strict

    def __repr__(self) -> str:
        """Return name, lift, type of follower and number of segments."""
        lift = str(self.lift).partition(" (")[0]
        kind, count = self.follower.type, len(self.segments)
        return f"Cam({self.name!r}: lift {lift}, {kind}, {count} segment{'s' * (count > 1)})"

    def replace(self, **changes: object) -> CamConfig:
        """Return the cam with other values.

        Parameters
        ----------
        **changes
            Parameters of the cam or sizes of its follower, by name. A number is in SI units, or a
            text with a unit.

        Raises
        ------
        ConfigError
            If a name is unknown, or a value is out of range.

        Examples
        --------
        >>> import cam_rig
        >>> cam_rig.load_cam("poly345").replace(base_radius="60 mm").follower.base_radius
        60 mm (assumed)
        """
        data: dict[str, Any] = dict(self)
        sizes = type(self.follower).model_fields.keys() & changes.keys()
        if sizes:
            data["follower"] = dict(self.follower) | {key: changes.pop(key) for key in sizes}
        return self._replaced(data | changes)

    @model_validator(mode="after")
    def _check_name_and_spans(self) -> CamConfig:
        if self.name in FRAMES:
            raise ValueError(
                f"name: is {self.name!r}, another frame of the rig; allowed: any name but "
                f"{', '.join(FRAMES)}"
            )
        total = sum(math.degrees(segment.span.si) for segment in self.segments)
        if abs(total - 360.0) > 1e-9:
            raise ValueError(
                f"segments: spans sum to {total:.9g}°; allowed: 360° "
                f"({'missing' if total < 360.0 else 'too much by'} {abs(360.0 - total):.9g}°)"
            )
        return self

    def numbers(self) -> dict[str, Quantity]:
        """Return the numbers of the file by their paths, such as "segments[0].span".

        The paths of the follower's numbers are without the prefix "follower.".
        """
        return {
            key.removeprefix("follower."): number for key, number in iterate_quantities(self, "")
        }

    @property
    def parts(self) -> ContactParts:
        """Width, material and permissible values of the contact, with defaults."""
        return self.contact or ContactParts()

    @property
    def files(self) -> list[str]:
        """Names of the CSV files of measured points that the laws ``table`` refer to."""
        return [segment.file.file for segment in self.segments if isinstance(segment, Table)]
