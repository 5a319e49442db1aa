"""A rig file: the follower's mechanics and the sound they make."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, ValidationError

from cam_rig.errors import ConfigError
from cam_rig.schema.explain import explain
from cam_rig.schema.quantity import Quantity, Strict, must_be

Mass = Annotated[Quantity, must_be("mass", above=0.0, least=1e-9, most=1e6)]
Stiffness = Annotated[Quantity, must_be("stiffness", above=0.0, least=1e-9, most=1e15)]
Damping = Annotated[Quantity, must_be("damping", least=0.0, most=1e9)]
Force = Annotated[Quantity, must_be("force", least=0.0, most=1e9)]
RollerShare = Annotated[Quantity, must_be("ratio", above=0.0, least=1e-6, most=0.99)]


#: SI units of the follower's numbers that have one.
SI_UNITS = {
    "mass": "kg",
    "spring_stiffness": "N/m",
    "stem_stiffness": "N/m",
    "damping": "N*s/m",
    "stem_damping": "N*s/m",
    "preload": "N",
}


class FollowerMechanics(Strict):
    """The follower on its closing spring; what may be None is asked for by `RigConfig.need`.

    The stem by an elastic stem, two masses, the sound of a landing; ``restitution`` by a model that
    lands; ``roller_share``, the mass on the cam's side, and ``stem_damping`` by two masses.
    """

    mass: Mass
    spring_stiffness: Stiffness
    stem_stiffness: Stiffness | None = None
    damping: Damping
    preload: Force
    roller_share: RollerShare | None = None
    stem_damping: Damping | None = None
    restitution: Annotated[Quantity, must_be("ratio", least=0.0, most=0.999)] | None = None


class Radiation(Strict):
    """Contact force to sound: gain and corner of the structure, and the background."""

    gain: Annotated[Quantity, must_be("radiation", above=0.0, most=1e3)]
    corner: Annotated[Quantity, must_be("frequency", above=0.0, most=1e6)]
    background: Annotated[Quantity, must_be("level", least=-50.0, most=200.0)]
    background_at: Annotated[Quantity, must_be("speed", above=0.0)]
    background_slope: Annotated[Quantity, must_be("level slope", least=-60.0, most=60.0)]
    background_corner: Annotated[Quantity, must_be("frequency", above=0.0, most=1e6)] = Quantity(
        assumed=500.0, unit="Hz", source="motor and bearings; no source prints it"
    )
    calibrated_on: str = ""


class Shaft(Strict):
    """The shaft between flywheel and cam, for the model ``torsional``.

    Without ``flywheel_inertia`` the flywheel holds its speed, as in eq. 10 of the paper; with it,
    a constant torque, the mean of the load, drives it.
    """

    cam_inertia: Annotated[Quantity, must_be("inertia", above=0.0, least=1e-12, most=1e9)]
    stiffness: Annotated[Quantity, must_be("torsional stiffness", above=0.0, least=1e-9, most=1e15)]
    damping: Annotated[Quantity, must_be("torsional damping", least=0.0, most=1e9)]
    flywheel_inertia: (
        Annotated[Quantity, must_be("inertia", above=0.0, least=1e-6, most=1e9)] | None
    ) = None


class RigConfig(Strict):
    """One file of ``config/rigs/``."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    title: str
    follower: FollowerMechanics
    shaft: Shaft | None = None
    radiation: Radiation | None = None

    @property
    def calibrated_on(self) -> str:
        """The cam whose noise the sound was fitted to; empty for none."""
        return "" if self.radiation is None else self.radiation.calibrated_on

    def need(self, key: str, by: str, instead: str = "") -> Quantity:
        """A number of the follower that the file may leave out; ``by`` says what needs it.

        Raises
        ------
        ConfigError : it is left out; ``instead`` is another remedy than to add it
        """
        number: Quantity | None = getattr(self.follower, key)
        if number is None:
            raise self.missing(f"follower.{key}", by, instead)
        return number

    def need_radiation(self, by: str) -> Radiation:
        """The section ``radiation``, for what is named by ``by``."""
        if self.radiation is None:
            raise self.missing("radiation", by)
        return self.radiation

    def missing(self, key: str, by: str, instead: str = "") -> ConfigError:
        """What is said where a key is used that the file leaves out."""
        other = f", or {instead}" if instead else ""
        return ConfigError(
            f"rig {self.name}: {key}: is missing; needed by {by}; so add it to the rig file{other}"
        )

    def with_follower(self, **numbers: float) -> RigConfig:
        """The same rig with other numbers of its follower, in SI units; their origin is assumed.

        Raises
        ------
        ConfigError : no such number, or a value out of range

        Examples
        --------
        >>> import cam_rig
        >>> rig = cam_rig.load_rig("paper_table2").with_follower(preload=45.0)  # N
        >>> rig.follower.preload.origin, rig.follower.preload.si
        ('assumed', 45.0)
        """
        data = self.model_dump(exclude_none=True)
        for key, value in numbers.items():
            unit = SI_UNITS.get(key, "1")
            data["follower"][key] = {"assumed": value, "unit": unit, "source": "with_follower"}
        for key in ("gain", "corner"):  # they were fitted with the other follower
            number = data.get("radiation", {}).get(key, {})
            if "identified" in number:
                number["assumed"] = number.pop("identified")
        try:
            return RigConfig.model_validate(data)
        except ValidationError as error:
            raise ConfigError(f"rig {self.name!r}: {explain(error, RigConfig)}") from None
