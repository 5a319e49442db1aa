"""A cam file: its law as segments around the turn, its follower, and where they come from."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, ValidationError, model_validator

from cam_rig.schema.explain import made, refused
from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.schema.segment_base import SegmentBase, Table, quantities
from cam_rig.schema.segments import Segment

Width = Annotated[Quantity, must_be("length", above=0.0, least=1e-6, most=10.0)]
Modulus = Annotated[Quantity, must_be("pressure", above=0.0, least=1e6, most=1e13)]
#: An incompressible solid has 0.5.
Poisson = Annotated[Quantity, must_be("ratio", least=0.0, most=0.5)]
Pressure = Annotated[Quantity, must_be("pressure", above=0.0, most=1e13)]
Sliding = Annotated[Quantity, must_be("linear speed", above=0.0, most=1e4)]


def _assumed(value: float, unit: str, source: str) -> Quantity:
    return Quantity(assumed=value, unit=unit, source=source)


class ContactParts(Strict):
    """The section ``contact`` of a cam file; every key may be left out.

    ``tip_radius`` is that of a point follower: an actual point would have infinite pressure. By
    default the follower is of the cam's material. ``most_pressure`` and ``most_sliding_speed``
    bound the base radius from below and from above.
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


Length = Annotated[Quantity, must_be("length", above=0.0, most=100.0)]
Offset = Annotated[Quantity, must_be("length", least=-100.0, most=100.0)]
#: A face is inclined by less than a right angle.
Inclination = Annotated[Quantity, must_be("angle", least=-1.5, most=1.5)]
Steepest = Annotated[Quantity, must_be("angle", above=0.0, most=0.5 * math.pi)]
#: Between two arms of one rocker.
ArmsAngle = Annotated[Quantity, must_be("angle", above=0.0, most=2.0 * math.pi)]
Radius = Annotated[Quantity, must_be("length", least=0.0, most=100.0)]


class BaseFollower(Strict):
    """What every follower has.

    ``least_curvature_radius`` (0 when not given) is what contact stress asks of convex parts,
    ``most_pressure_angle`` what the guide or the pivot bears: 30° and 45° when not given.
    """

    #: Whether a spring alone holds it on the cam, as the dynamic models take it.
    sprung: ClassVar[bool] = True

    base_radius: Length
    least_curvature_radius: Radius | None = None
    most_pressure_angle: Steepest | None = None

    @property
    def roller(self) -> float:
        """Roller radius in m, 0 for a follower without one."""
        return 0.0


class _Rolling(BaseFollower):
    roller_radius: Length

    @property
    def roller(self) -> float:
        """Roller radius in m."""
        return self.roller_radius.si


class _Guided(BaseFollower):
    """Its guide runs past the cam's axis at ``eccentricity``, towards +x."""

    eccentricity: Offset | None = None


class _Pivoted(BaseFollower):
    """Swings about a pivot at ``pivot_distance`` from the cam's axis; the law is at ``arm``.

    A rig's numbers are those at the arm's end, along its arc: mass J/arm², stiffness and damping
    of the arm over arm², moments over arm. Then J φ'' = M is m s'' = F with s = arm φ, exactly.
    """

    pivot_distance: Length
    arm: Length


class _Positive(BaseFollower):
    """The cam moves it both ways: it cannot leave the cam."""

    sprung: ClassVar[bool] = False


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

    ``roller_distance`` of the axes is 2 (R_b + R_r) + s_max, for one prime circle, if not given.
    """

    type: Literal["conjugate"]
    roller_distance: Length | None = None


class OscillatingConjugate(_Positive, _Pivoted, _Rolling):
    """Two arms about one pivot, a roller at the end of each on its own cam of one shaft.

    The second arm is as long, on the other side of the cam's axis. ``arms_angle`` is between them:
    2 γ + s_max / arm, for one prime circle, if not given; γ is the first arm's angle at no lift.
    """

    type: Literal["oscillating_conjugate"]
    arms_angle: ArmsAngle | None = None


Translating = Point | Roller | Flat | InclinedFlat
Oscillating = OscillatingPoint | OscillatingRoller | OscillatingFlat
Desmodromic = ConstantBreadth | ConstantDiameter | Conjugate | OscillatingConjugate
Follower = Annotated[Translating | Oscillating | Desmodromic, Field(discriminator="type")]
#: Frames of the rig's robot besides one for each cam, which bears the cam's name.
FRAMES = ("base_link", "guide", "motor", "microphone", "cam", "follower", "follower_arc")


class CamConfig(Strict):
    """One file of ``config/cams/``; in Python a law as segments around the turn, and a follower.

    `parts` has the defaults of ``contact``; ``cannot_be_made`` says why a cam fails a check and is
    meant to, to be looked at only.

    Parameters
    ----------
    name, title : of the cam; the name is its file's
    lift : m, or a text with its unit
    segments : in the order of the cam angle, as a file has them: mappings of ``law``, ``span`` (rad
        or a text) and the law's own keys; their spans are one turn together
    follower : its ``type`` and sizes, as a file has them
    contact : width, material and permissible values

    Raises
    ------
    ConfigError : something is missing, out of range, or none

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

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    title: str
    identified_from: str | None = None
    cannot_be_made: str | None = Field(default=None, min_length=1)
    lift: Annotated[Quantity, must_be("length", above=0.0, most=100.0)]
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
        data = {"lift": lift, "segments": segments, "follower": follower, "contact": contact}
        words = {"identified_from": identified_from, "cannot_be_made": cannot_be_made}
        try:
            super().__init__(name=name, title=name if title is None else title, **data, **words)
        except ValidationError as error:
            raise refused("cam", name, error, CamConfig) from None

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]  # as in Strict

    def __repr__(self) -> str:
        """Name, lift, follower and how many segments."""
        lift = str(self.lift).partition(" (")[0]
        kind, count = self.follower.type, len(self.segments)
        return f"Cam({self.name!r}: lift {lift}, {kind}, {count} segment{'s' * (count > 1)})"

    __str__ = __repr__

    def replace(self, **changes: object) -> CamConfig:
        """The same cam with something else: a section, its name or lift, a size of its follower.

        Numbers are plain in SI, or texts with a unit.

        Raises
        ------
        ConfigError : no such name, or a value out of range

        Examples
        --------
        >>> import cam_rig
        >>> cam_rig.load_cam("poly345").replace(base_radius="60 mm").follower.base_radius
        60 mm (assumed)
        """
        data: dict[str, Any] = dict(self)
        own = type(self.follower).model_fields.keys() & changes.keys()
        if own:
            data["follower"] = dict(self.follower) | {key: changes.pop(key) for key in own}
        return made(CamConfig, data | changes, "cam")

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the cam's file, whole or not at all; it has the name of the file.

        The points of a law of points are a .csv file beside it.

        Raises
        ------
        ConfigError : the file's name is none of a cam
        OutputError : it cannot be written, or is there already without ``overwrite``

        Examples
        --------
        >>> import tempfile, cam_rig
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     cam_rig.load_cam("poly345").replace(lift="30 mm").save(f"{folder}/mine.yaml")
        ...     print(cam_rig.load_cam(f"{folder}/mine.yaml"))
        Cam('mine': lift 30 mm, roller, 5 segments)
        """
        from cam_rig.schema.load import save_model

        save_model(self, path, overwrite)

    @model_validator(mode="after")
    def _named_and_whole(self) -> CamConfig:
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
        """Every number of the file by its key, the follower's by theirs alone."""
        return {key.removeprefix("follower."): number for key, number in quantities(self, "")}

    @property
    def parts(self) -> ContactParts:
        """Width, material and permissible values of the contact, assumed where not given."""
        return self.contact or ContactParts()

    @property
    def files(self) -> list[str]:
        """Names of the files beside the cam's own that it is made of."""
        return [segment.file.file for segment in self.segments if isinstance(segment, Table)]
