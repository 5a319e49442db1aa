"""Rig files: the mechanics of the follower, the shaft and the radiated sound."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from cam_rig.errors import ConfigError
from cam_rig.schema.named import NamedConfig
from cam_rig.schema.quantity import Quantity, Strict, must_be

if TYPE_CHECKING:
    from scipy.signal import StateSpace

    from cam_rig.units import ComplexArray, FloatArray

#: Module of the linear models. It is imported on demand, because it belongs to a higher layer.
LINEAR = "cam_rig.dynamics.linear.rig_model"
Mass = Annotated[Quantity, must_be("mass", gt=0.0, ge=1e-9, le=1e6)]
Stiffness = Annotated[Quantity, must_be("stiffness", gt=0.0, ge=1e-9, le=1e15)]
Damping = Annotated[Quantity, must_be("damping", ge=0.0, le=1e9)]
Force = Annotated[Quantity, must_be("force", ge=0.0, le=1e9)]
RollerShare = Annotated[Quantity, must_be("ratio", gt=0.0, ge=1e-6, le=0.99)]


class FollowerMechanics(Strict):
    """Follower on its closing spring.

    A model that needs an optional number calls `RigConfig.need`, which raises ConfigError for None.

    Parameters
    ----------
    mass : Quantity
        Mass of the follower, kg.
    spring_stiffness : Quantity
        Stiffness of the closing spring, N/m.
    stem_stiffness : Quantity or None
        Stiffness of the stem, N/m. Needed by elastic_stem, two_mass and the sound of a landing.
    damping : Quantity
        Damping parallel to the closing spring, N·s/m.
    preload : Quantity
        Force of the spring at zero lift, N.
    roller_share : Quantity or None
        Fraction of the mass on the cam's side of the stem. Needed by two_mass.
    stem_damping : Quantity or None
        Damping of the stem, N·s/m. Needed by two_mass.
    restitution : Quantity or None
        Coefficient of restitution of a landing. Needed by models with landings.
    """

    mass: Mass
    spring_stiffness: Stiffness
    stem_stiffness: Stiffness | None = None
    damping: Damping
    preload: Force
    roller_share: RollerShare | None = None
    stem_damping: Damping | None = None
    restitution: Annotated[Quantity, must_be("ratio", ge=0.0, le=0.999)] | None = None


class Radiation(Strict):
    """Radiation of sound by the contact force, and the background noise.

    Parameters
    ----------
    gain : Quantity
        Gain of the structure, Pa·s/N.
    corner_frequency : Quantity
        Corner frequency of the structure, Hz.
    background : Quantity
        Level of the background at the speed `background_reference_speed` (rad/s), dB.
    background_slope : Quantity
        Increase of the background with the speed, dB per octave.
    background_corner_frequency : Quantity
        Corner frequency of the background, Hz (default: 500 Hz, assumed).
    calibrated_on : str
        Cam whose levels gain and corner were fitted to, or empty.
    """

    earlier_keys: ClassVar = {
        "corner": "corner_frequency",
        "background_at": "background_reference_speed",
        "background_corner": "background_corner_frequency",
    }

    gain: Annotated[Quantity, must_be("radiation", gt=0.0, le=1e3)]
    corner_frequency: Annotated[Quantity, must_be("frequency", gt=0.0, le=1e6)]
    background: Annotated[Quantity, must_be("level", ge=-50.0, le=200.0)]
    background_reference_speed: Annotated[Quantity, must_be("speed", gt=0.0)]
    background_slope: Annotated[Quantity, must_be("level slope", ge=-60.0, le=60.0)]
    background_corner_frequency: Annotated[Quantity, must_be("frequency", gt=0.0, le=1e6)] = (
        Quantity(assumed=500.0, unit="Hz", source="motor and bearings; no source prints it")
    )
    calibrated_on: str = ""


class Shaft(Strict):
    """Shaft between flywheel and cam, for the model torsional.

    Parameters
    ----------
    cam_inertia : Quantity
        Moment of inertia of the cam, kg·m².
    stiffness : Quantity
        Torsional stiffness, N·m/rad.
    damping : Quantity
        Torsional damping, N·m·s/rad.
    flywheel_inertia : Quantity or None
        Moment of inertia of the flywheel, kg·m². A constant torque, the mean of the load, drives
        the flywheel. By default its speed is constant, as in eq. 10 of the paper.
    """

    cam_inertia: Annotated[Quantity, must_be("inertia", gt=0.0, ge=1e-12, le=1e9)]
    stiffness: Annotated[Quantity, must_be("torsional stiffness", gt=0.0, ge=1e-9, le=1e15)]
    damping: Annotated[Quantity, must_be("torsional damping", ge=0.0, le=1e9)]
    flywheel_inertia: Annotated[Quantity, must_be("inertia", gt=0.0, ge=1e-6, le=1e9)] | None = None


def _si(number: Quantity | None) -> float | None:
    """Return a number in SI units, or None if it is missing."""
    return None if number is None else number.si


#: Number in SI, text with number and unit such as "3.2 N/mm", or quantity with its origin.
NumberLike = float | str | Quantity


class RigConfig(NamedConfig):
    """Rig: a follower on its spring, its shaft and its sound.

    A file of ``config/rigs/`` contains one rig. In Python, numbers in SI units and texts with
    a unit are accepted as assumed numbers.

    Parameters
    ----------
    name : str
        Name of the rig, and of its file: small letters, digits and _ (default: default_rig).
    title : str or None
        Title in figures and reports (default: the name).
    follower, shaft, radiation : mapping or None
        Sections, as in a file.
    mass, spring, preload, damping : float, str or Quantity
        Numbers of the follower in kg, N/m, N, N·s/m, instead of `follower`. The default of the
        damping is 0.
    **others
        Further numbers of the follower, as in a file: `stem_stiffness` (N/m), `roller_share`,
        `stem_damping` (N·s/m), `restitution`.

    Raises
    ------
    ConfigError
        If a number is missing, out of range, or not a number.

    Examples
    --------
    >>> import cam_rig
    >>> rig = cam_rig.Rig("bench", mass=1.3, spring="3.2 N/mm", preload=30.0)
    >>> rig
    Rig('bench': mass 1.3 kg, spring_stiffness 3.2 N/mm, damping 0 N*s/m, preload 30 N)
    >>> rig.mass, rig.spring_stiffness, rig.restitution  # kg, N/m, and no restitution
    (1.3, 3200.0, None)
    >>> rig.replace(preload="4 kN")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    cam_rig.errors.ConfigError: rig 'bench': follower.preload: has unit 'kN', not a force; ...
    """

    kind = "rig"

    follower: FollowerMechanics
    shaft: Shaft | None = None
    radiation: Radiation | None = None

    def __init__(
        self,
        name: str = "default_rig",
        title: str | None = None,
        *,
        follower: FollowerMechanics | Mapping[str, object] | None = None,
        shaft: Shaft | Mapping[str, object] | None = None,
        radiation: Radiation | Mapping[str, object] | None = None,
        mass: NumberLike | None = None,
        spring: NumberLike | None = None,
        preload: NumberLike | None = None,
        damping: NumberLike | None = None,
        **others: NumberLike,
    ) -> None:
        main = {"mass": mass, "spring_stiffness": spring, "preload": preload, "damping": damping}
        numbers = {key: number for key, number in main.items() if number is not None} | others
        if follower is None:
            follower = {"damping": 0.0, **numbers}
        elif numbers:
            raise ConfigError(
                f"rig {name!r}: follower and {', '.join(numbers)}; allowed: numbers alone, or the "
                "section follower"
            )
        super().__init__(name, title, follower=follower, shaft=shaft, radiation=radiation)

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]  # as in Strict

    def __repr__(self) -> str:
        """Return the name and the numbers of the follower."""
        numbers = ((key, number) for key, number in self.follower if number is not None)
        texts = (f"{key} {str(number).partition(' (')[0]}" for key, number in numbers)
        return f"Rig({self.name!r}: {', '.join(texts)})"

    @property
    def mass(self) -> float:
        """Mass of the follower, kg."""
        return self.follower.mass.si

    @property
    def spring_stiffness(self) -> float:
        """Stiffness of the closing spring, N/m."""
        return self.follower.spring_stiffness.si

    @property
    def damping(self) -> float:
        """Damping parallel to the closing spring, N·s/m."""
        return self.follower.damping.si

    @property
    def preload(self) -> float:
        """Force of the spring at zero lift, N."""
        return self.follower.preload.si

    @property
    def stem_stiffness(self) -> float | None:
        """Stiffness of the stem, N/m, or None."""
        return _si(self.follower.stem_stiffness)

    @property
    def roller_share(self) -> float | None:
        """Fraction of the mass on the cam's side of the stem, or None."""
        return _si(self.follower.roller_share)

    @property
    def stem_damping(self) -> float | None:
        """Damping of the stem, N·s/m, or None."""
        return _si(self.follower.stem_damping)

    @property
    def restitution(self) -> float | None:
        """Coefficient of restitution of a landing, or None."""
        return _si(self.follower.restitution)

    @property
    def calibrated_on(self) -> str:
        """Name of the cam whose levels the radiation was fitted to, or empty."""
        return "" if self.radiation is None else self.radiation.calibrated_on

    def need(self, key: str, by: str, instead: str = "") -> Quantity:
        """Return an optional number of the follower. Raise ConfigError if it is missing.

        Parameters
        ----------
        key : str
            Key of the number in the section ``follower``.
        by : str
            Model or quantity that needs it, for the message.
        instead : str
            Remedy other than to add the number, for the message.
        """
        return self.need_all((key,), by, instead)[0]

    def need_all(self, keys: Sequence[str], by: str, instead: str = "") -> list[Quantity]:
        """Return optional numbers of the follower. Raise ConfigError that names all missing ones.

        The arguments are those of `need`, with several keys.
        """
        numbers: dict[str, Quantity | None] = {key: getattr(self.follower, key) for key in keys}
        if missing := [f"follower.{key}" for key, number in numbers.items() if number is None]:
            raise self.missing(missing, by, instead)
        return [number for number in numbers.values() if number is not None]

    def need_radiation(self, by: str) -> Radiation:
        """Return the section ``radiation``. Raise ConfigError if it is missing.

        `by` is the quantity that needs it, for the message.
        """
        if self.radiation is None:
            raise self.missing(["radiation"], by)
        return self.radiation

    def missing_for_sound(self, lands: bool) -> tuple[str, ...]:
        """Return the missing keys that a sound level needs.

        `lands` is True if the follower may land, because the sound of a landing depends on the
        stem.
        """
        keys = [] if self.radiation is not None else ["radiation"]
        if lands and self.follower.stem_stiffness is None:
            keys.append("follower.stem_stiffness")
        return tuple(keys)

    def missing(self, keys: Sequence[str], by: str, instead: str = "") -> ConfigError:
        """Return the error for missing keys that a model or quantity needs.

        The other arguments are those of `need`.
        """
        other = f", or {instead}" if instead else ""
        python = ", ".join(f"{key.rpartition('.')[2]}=..." for key in keys)
        are, them = ("is", "it") if len(keys) == 1 else ("are", "them")
        return ConfigError(
            f"rig {self.name}: {', '.join(keys)}: {are} missing; needed by {by}; so add {them} to "
            f"the rig file, in Python by rig.replace({python}){other}"
        )

    def with_follower(self, **numbers: float) -> RigConfig:
        """Return the rig with other numbers of its follower. Their origin is assumed.

        Parameters
        ----------
        **numbers : float
            Numbers of the section ``follower`` by key, in SI units.

        Raises
        ------
        ConfigError
            If a key is unknown, or a value is out of range.

        Examples
        --------
        >>> import cam_rig
        >>> rig = cam_rig.load_rig("paper_table2").with_follower(preload=45.0)  # N
        >>> rig.follower.preload.origin, rig.follower.preload.si
        ('assumed', 45.0)
        """
        return self._replaced(self._data_with(numbers))

    def _data_with(self, numbers: Mapping[str, object]) -> dict[str, Any]:
        """Return the rig as data, with other numbers of its follower.

        Gain and corner of the radiation, which were fitted with the old numbers, are then assumed.
        """
        data = self.model_dump(exclude_none=True)
        data["follower"] |= numbers
        for key in ("gain", "corner_frequency") if numbers else ():
            number = data.get("radiation", {}).get(key, {})
            if "identified" in number:
                number["assumed"] = number.pop("identified")
        return data

    def replace(self, **changes: object) -> RigConfig:
        """Return the rig with other values.

        If a number of the follower changes, gain and corner of the radiation are then assumed,
        because they were fitted with the old follower.

        Parameters
        ----------
        **changes
            Parameters of `Rig` or keys of the section ``follower``. A number is in SI units, or a
            text with a unit.

        Raises
        ------
        ConfigError
            If a name is unknown, or a value is out of range.

        Examples
        --------
        >>> import cam_rig
        >>> cam_rig.load_rig("tm21").replace(name="stiffer", spring="6 N/mm").follower.preload
        12.753 N (assumed)
        """
        if "spring" in changes:
            changes["spring_stiffness"] = changes.pop("spring")
        fields = {key: changes.pop(key) for key in tuple(changes) if key in RigConfig.model_fields}
        return self._replaced(self._data_with(changes) | fields)

    def state_space(self, model: str | None = None) -> StateSpace:
        """Return the linear model of the follower in contact, for scipy.signal.

        The inputs are the law and its time derivatives (s, ṡ, s̈), so that every output is proper.
        The outputs are displacement (m), velocity (m/s) and acceleration (m/s²) of the follower, or
        of the end mass in two_mass, and the contact force (N). All are deviations from the state
        under preload alone. The state is the vibration about the static fraction of the lift.
        ``control.ss`` of python-control accepts the matrices ``A``, ``B``, ``C``, ``D``.

        Parameters
        ----------
        model : str or None
            two_mass or elastic_stem (default: the most detailed model that the rig has the numbers
            for).

        Returns
        -------
        scipy.signal.StateSpace

        Raises
        ------
        ConfigError
            If the model is unknown, or the rig has no stem and thus no state in contact.

        Examples
        --------
        >>> import cam_rig
        >>> system = cam_rig.load_rig("paper_table2").state_space()
        >>> system.A.shape, system.B.shape, system.C.shape
        ((2, 2), (2, 3), (4, 2))
        """
        system: StateSpace = import_module(LINEAR).state_space(self, model)
        return system

    def frequency_response(self, w: float | FloatArray, model: str | None = None) -> ComplexArray:
        """Return the response of the follower in contact to a lift of amplitude 1 m.

        Parameters
        ----------
        w : float or array
            Angular frequencies, rad/s, any shape.
        model : str or None
            two_mass, elastic_stem or one_mass (default: the most detailed model that the rig has
            the numbers for).

        Returns
        -------
        complex array, shape (4, *w.shape)
            Displacement (m/m), velocity (1/s), acceleration (1/s²), contact force (N/m).

        Raises
        ------
        ConfigError
            If the model is unknown, the rig lacks a number, or a frequency is not a number.
        DynamicsError
            If a frequency is that of a mode without damping.

        Examples
        --------
        >>> import cam_rig, numpy as np
        >>> rig = cam_rig.Rig(mass=1.3, spring=4000.0, preload=30.0)
        >>> force = rig.frequency_response(np.array([0.0, 100.0]))[3]  # k - m w^2
        >>> force.real.round(6).tolist()
        [4000.0, -9000.0]
        """
        response: ComplexArray = import_module(LINEAR).frequency_response(self, w, model)
        return response
