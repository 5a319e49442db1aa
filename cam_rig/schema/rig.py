"""A rig file: the follower's mechanics and the sound they make."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, ValidationError

from cam_rig.errors import ConfigError
from cam_rig.schema.explain import made, refused
from cam_rig.schema.quantity import Quantity, Strict, must_be

if TYPE_CHECKING:
    from scipy.signal import StateSpace

    from cam_rig.units import ComplexArray, FloatArray

#: What a rig's dynamics are asked: it stands above this room, which names it in words alone.
LINEAR = "cam_rig.dynamics.linear.rig_model"
Mass = Annotated[Quantity, must_be("mass", gt=0.0, ge=1e-9, le=1e6)]
Stiffness = Annotated[Quantity, must_be("stiffness", gt=0.0, ge=1e-9, le=1e15)]
Damping = Annotated[Quantity, must_be("damping", ge=0.0, le=1e9)]
Force = Annotated[Quantity, must_be("force", ge=0.0, le=1e9)]
RollerShare = Annotated[Quantity, must_be("ratio", gt=0.0, ge=1e-6, le=0.99)]


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
    restitution: Annotated[Quantity, must_be("ratio", ge=0.0, le=0.999)] | None = None


class Radiation(Strict):
    """Contact force to sound: gain and corner of the structure, and the background."""

    gain: Annotated[Quantity, must_be("radiation", gt=0.0, le=1e3)]
    corner: Annotated[Quantity, must_be("frequency", gt=0.0, le=1e6)]
    background: Annotated[Quantity, must_be("level", ge=-50.0, le=200.0)]
    background_at: Annotated[Quantity, must_be("speed", gt=0.0)]
    background_slope: Annotated[Quantity, must_be("level slope", ge=-60.0, le=60.0)]
    background_corner: Annotated[Quantity, must_be("frequency", gt=0.0, le=1e6)] = Quantity(
        assumed=500.0, unit="Hz", source="motor and bearings; no source prints it"
    )
    calibrated_on: str = ""


class Shaft(Strict):
    """The shaft between flywheel and cam, for the model ``torsional``.

    Without ``flywheel_inertia`` the flywheel holds its speed, as in eq. 10 of the paper; with it,
    a constant torque, the mean of the load, drives it.
    """

    cam_inertia: Annotated[Quantity, must_be("inertia", gt=0.0, ge=1e-12, le=1e9)]
    stiffness: Annotated[Quantity, must_be("torsional stiffness", gt=0.0, ge=1e-9, le=1e15)]
    damping: Annotated[Quantity, must_be("torsional damping", ge=0.0, le=1e9)]
    flywheel_inertia: Annotated[Quantity, must_be("inertia", gt=0.0, ge=1e-6, le=1e9)] | None = None


#: A number in SI, a text with one and its unit as "3.2 N/mm", or one with its origin.
Given = float | str | Quantity


class RigConfig(Strict):
    """One file of ``config/rigs/``; in Python a follower on its spring, and what it turns on.

    Parameters
    ----------
    name, title : of the rig; the name is its file's
    follower, shaft, radiation : sections as a file has them, their numbers plain in SI, or texts
        with a unit
    mass, spring, preload, damping : of the follower, in place of ``follower``: kg, N/m, N, N·s/m;
        plain in SI or texts with a unit; all are then assumed
    others : ``stem_stiffness`` (N/m), ``roller_share``, ``stem_damping`` (N·s/m),
        ``restitution``, as a file has them

    Raises
    ------
    ConfigError : a number is missing, out of range, or none

    Examples
    --------
    >>> import cam_rig
    >>> rig = cam_rig.Rig("bench", mass=1.3, spring="3.2 N/mm", preload=30.0)
    >>> rig
    Rig('bench': mass 1.3 kg, spring_stiffness 3.2 N/mm, damping 0 N*s/m, preload 30 N)
    >>> rig.replace(preload="4 kN")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    cam_rig.errors.ConfigError: rig 'bench': follower.preload: has unit 'kN', not a force; ...
    """

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    title: str
    follower: FollowerMechanics
    shaft: Shaft | None = None
    radiation: Radiation | None = None

    def __init__(
        self,
        name: str = "own_rig",
        title: str | None = None,
        *,
        follower: FollowerMechanics | Mapping[str, object] | None = None,
        shaft: Shaft | Mapping[str, object] | None = None,
        radiation: Radiation | Mapping[str, object] | None = None,
        mass: Given | None = None,
        spring: Given | None = None,
        preload: Given | None = None,
        damping: Given | None = None,
        **others: Given,
    ) -> None:
        named = {"mass": mass, "spring_stiffness": spring, "preload": preload, "damping": damping}
        numbers = {key: one for key, one in named.items() if one is not None} | others
        if follower is None:
            follower = {"damping": 0.0, **numbers}
        elif numbers:
            raise ConfigError(
                f"rig {name!r}: follower and {', '.join(numbers)}; allowed: numbers alone, or the "
                "section follower"
            )
        data = {"name": name, "title": name if title is None else title, "follower": follower}
        try:
            super().__init__(**data, shaft=shaft, radiation=radiation)
        except ValidationError as error:
            raise refused("rig", name, error, RigConfig) from None

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]  # as in Strict

    def __repr__(self) -> str:
        """Name and the follower's numbers."""
        numbers = ((key, one) for key, one in self.follower if one is not None)
        words = ", ".join(f"{key} {str(one).partition(' (')[0]}" for key, one in numbers)
        return f"Rig({self.name!r}: {words})"

    __str__ = __repr__

    @property
    def calibrated_on(self) -> str:
        """The cam whose noise the sound was fitted to; empty for none."""
        return "" if self.radiation is None else self.radiation.calibrated_on

    def need(self, key: str, by: str, instead: str = "") -> Quantity:
        """A number that the file may leave out: what needs it, another remedy than to add it."""
        number: Quantity | None = getattr(self.follower, key)
        if number is None:
            raise self.missing(f"follower.{key}", by, instead)
        return number

    def need_radiation(self, by: str) -> Radiation:
        """The section ``radiation``, for what is named by ``by``."""
        if self.radiation is None:
            raise self.missing("radiation", by)
        return self.radiation

    def missing_for_sound(self, lands: bool) -> tuple[str, ...]:
        """Return the keys that a sound level needs and the file leaves out.

        With `lands` the follower may land, whose sound depends on its stem.
        """
        keys = [] if self.radiation is not None else ["radiation"]
        if lands and self.follower.stem_stiffness is None:
            keys.append("follower.stem_stiffness")
        return tuple(keys)

    def missing(self, key: str, by: str, instead: str = "") -> ConfigError:
        """What is said where a key is used that the file leaves out."""
        other = f", or {instead}" if instead else ""
        python = f"rig.replace({key.rpartition('.')[2]}=...)"
        return ConfigError(
            f"rig {self.name}: {key}: is missing; needed by {by}; so add it to the rig file, in "
            f"Python by {python}{other}"
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
        given = {
            key: {"assumed": value, "unit": SI_UNITS.get(key, "1"), "source": "with_follower"}
            for key, value in numbers.items()
        }
        return made(RigConfig, self._changed(given), "rig")

    def _changed(self, numbers: Mapping[str, object]) -> dict[str, Any]:
        """What the rig holds, with other numbers of its follower."""
        data = self.model_dump(exclude_none=True)
        data["follower"] |= numbers
        for key in ("gain", "corner") if numbers else ():  # fitted with the other follower
            number = data.get("radiation", {}).get(key, {})
            if "identified" in number:
                number["assumed"] = number.pop("identified")
        return data

    def replace(self, **changes: object) -> RigConfig:
        """The same rig with something else: a section, the name, or numbers of the follower.

        Numbers of the follower are plain in SI, or texts with a unit, by the names of `Rig` or of
        a rig file; gain and corner of the sound, fitted with the other, are then assumed.

        Raises
        ------
        ConfigError : no such name, or a value out of range

        Examples
        --------
        >>> import cam_rig
        >>> cam_rig.load_rig("tm21").replace(name="stiffer", spring="6 N/mm").follower.preload
        12.753 N (assumed)
        """
        if "spring" in changes:
            changes["spring_stiffness"] = changes.pop("spring")
        own = {key: changes.pop(key) for key in tuple(changes) if key in RigConfig.model_fields}
        return made(RigConfig, self._changed(changes) | own, "rig")

    def state_space(self, model: str | None = None) -> StateSpace:
        """The rig's own linear model in contact, for scipy.signal and python-control.

        Inputs are the law and its derivatives in time (s, ṡ, s̈), so that no output is improper;
        outputs displacement (m), velocity and acceleration of the follower, of two masses of the
        end mass, and the contact force (N), all less what the preload alone makes. The state is
        the vibration about the static share of the lift. ``control.ss`` takes the matrices
        ``A``, ``B``, ``C``, ``D``.

        Parameters
        ----------
        model : ``two_mass`` or ``elastic_stem``; None: the fullest that the rig has numbers for

        Raises
        ------
        ConfigError : no such model, or a rig without a stem, which has no state in contact

        Examples
        --------
        >>> import cam_rig
        >>> system = cam_rig.load_rig("paper_table2").state_space()
        >>> system.A.shape, system.B.shape, system.C.shape
        ((2, 2), (2, 3), (4, 2))
        """
        found: StateSpace = import_module(LINEAR).state_space(self, model)
        return found

    def frequency_response(self, w: float | FloatArray, model: str | None = None) -> ComplexArray:
        """What a lift of amplitude 1 m at angular frequencies makes of the follower in contact.

        Parameters
        ----------
        w : rad/s, one or an array of any shape
        model : ``two_mass``, ``elastic_stem`` or ``one_mass``; None: as `state_space`

        Returns
        -------
        ``(4, *w.shape)`` complex: displacement (m/m), velocity (1/s), acceleration (1/s²), contact
        force (N/m)

        Raises
        ------
        ConfigError : no such model, a number that the rig lacks, or frequencies that are none
        DynamicsError : the frequency of a mode without damping

        Examples
        --------
        >>> import cam_rig, numpy as np
        >>> rig = cam_rig.Rig(mass=1.3, spring=4000.0, preload=30.0)
        >>> force = rig.frequency_response(np.array([0.0, 100.0]))[3]  # k - m w^2
        >>> force.real.round(6).tolist()
        [4000.0, -9000.0]
        """
        found: ComplexArray = import_module(LINEAR).frequency_response(self, w, model)
        return found

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the rig's file, whole or not at all; it has the name of the file.

        Raises
        ------
        ConfigError : the file's name is none of a rig
        OutputError : it cannot be written, or is there already without ``overwrite``

        Examples
        --------
        >>> import tempfile, cam_rig
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     cam_rig.Rig(mass=1.3, spring=3200.0, preload=30.0).save(f"{folder}/bench.yaml")
        ...     print(cam_rig.load_rig(f"{folder}/bench.yaml").name)
        bench
        """
        from cam_rig.schema.load import save_model

        save_model(self, path, overwrite)
