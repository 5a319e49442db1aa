"""Base class of all lab sheets: question, set-ups, and the rig that is measured."""

from __future__ import annotations

import hashlib
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.files import shorten
from cam_rig.laws import Law, build_law
from cam_rig.laws.cam import require_sprung
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.units import FloatArray

#: Pattern of an accepted seed, which becomes part of a file's name.
SEED_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")


@dataclass(frozen=True)
class LabSetup:
    """Set-up of a reading: spring (N/m), added mass (kg), preload (N), cam.

    The cam is given by its name. A field is None if the lab does not vary it.
    """

    spring_stiffness: float | None = None
    added_mass: float | None = None
    preload: float | None = None
    cam: str | None = None


@dataclass(frozen=True)
class LabReading:
    """Row of a lab sheet: a reading or an answer.

    `number` starts at 1. `setup` contains the numbers on the sheet. `rpm` is the speed and
    `measured` the reading of the instrument, if the lab has one. If the lab asks for a quantity
    that is not read directly, a row of an answer contains only `answer`.
    """

    number: int
    setup: LabSetup
    rpm: float | None = None
    measured: float | None = None
    answer: float | None = None


@dataclass(frozen=True, eq=False)
class LabTurn:
    """Observed turn of the follower in steady state at one speed.

    `curve` has the resolution of its sensor, at equal steps of the cam angle from 0. `sound` is of
    full scale and is played in a loop. `measured` is the reading of the lab's instrument.
    `was_lost` is true if contact was lost on the way up to this speed. `lift` (mm) and `gap` (µm,
    between cam and follower) are those of the picture, at the angles of `curve`. The arrays are
    empty if the turn cannot be observed.
    """

    contact_lost: bool
    was_lost: bool
    curve: FloatArray = field(default_factory=lambda: np.empty(0))
    sound: FloatArray = field(default_factory=lambda: np.empty(0))
    measured: float | None = None
    lift: FloatArray = field(default_factory=lambda: np.empty(0))
    gap: FloatArray = field(default_factory=lambda: np.empty(0))


#: Lowest and highest value of a speed knob (rpm), or of an axis of the plot.
Span = tuple[float, float]


def hidden_factor(lab: str, seed: str, number: str, tolerance: float) -> float:
    """Return the factor between a hidden number and the number on the sheet.

    Parameters
    ----------
    lab, seed, number : str
        Names of the lab, the seed and the number. Equal names give equal factors on every machine.
    tolerance : float
        Largest relative difference.

    Returns
    -------
    float
        Factor between 1 - tolerance and 1 + tolerance, uniformly distributed by SHA-256.
    """
    data = hashlib.sha256(f"cam_rig\n{lab}\n{seed}\n{number}".encode()).digest()
    return 1.0 + tolerance * (2.0 * int.from_bytes(data[:8], "big") / (2**64 - 1) - 1.0)


@dataclass(frozen=True, eq=False)
class LabSheet(ABC):
    """Base class of the sheets of a lab, with one or two cams and a rig.

    `seed` selects a hidden rig, whose numbers differ from those on the sheet and which is measured.
    Without a seed, the rig on the sheet is measured.
    """

    name: ClassVar[str]
    #: Options of each field of `LabSetup`, as multiples of the rig's number. The options of the
    #: added mass are in kg.
    multiples: ClassVar[Mapping[str, tuple[float, ...]]] = {}
    #: Largest relative difference, in either direction, between each number of the hidden rig and
    #: that on the sheet.
    tolerances: ClassVar[Mapping[str, float]]
    #: Name of the column with the instrument's reading, None if only the speed is read.
    measured: ClassVar[str | None] = None
    #: Name of the quantity that the student determines, such as the jump speed.
    question: ClassVar[str]
    #: Unit of the student's answer.
    unit: ClassVar[str]
    #: Name of the column with the answer, None if the answer is the speed of a reading.
    answer: ClassVar[str | None] = None
    #: Text that defines the true value of the answer.
    truth: ClassVar[str]
    #: Default tolerance of an answer, %.
    default_tolerance: ClassVar[float] = 1.0
    #: Field of the set-up that selects the marker of a reading in the plot.
    marker: ClassVar[str] = "added_mass"
    #: Field of the set-up whose value selects a filled marker, unless it is the first option. None
    #: if no marker is filled.
    filled: ClassVar[str | None] = None
    #: True if the curve of a turn is the contact force, so that the follower may leave the cam.
    shows_force: ClassVar[bool] = True
    #: True if the page plays the sound of a turn.
    has_sound: ClassVar[bool] = True
    #: Name of the default second cam, None if the lab has one cam.
    default_other_cam: ClassVar[str | None] = None

    cam: CamConfig
    rig: RigConfig
    seed: str | None = None
    other: CamConfig | None = None

    def __post_init__(self) -> None:
        if self.seed is not None and not SEED_NAME.fullmatch(self.seed):
            raise ConfigError(
                f"--seed: is {shorten(self.seed)}; allowed: a name of 1 to 40 letters, digits, - "
                "and _"
            )
        for cam in self.cams.values():
            require_sprung(Path(cam.name), cam)

    @cached_property
    def cams(self) -> dict[str, CamConfig]:
        """Cams of the sheet by name."""
        return {cam.name: cam for cam in (self.cam, self.other) if cam is not None}

    @cached_property
    def laws(self) -> dict[str, Law]:
        """Laws of the cams by name."""
        return {name: build_law(cam) for name, cam in self.cams.items()}

    @property
    def law(self) -> Law:
        """Law of the first cam."""
        return self.laws[self.cam.name]

    @cached_property
    def options(self) -> dict[str, list[Any]]:
        """Options for each field of `LabSetup` that a student can choose.

        They are rounded to three digits, as in a catalogue.
        """
        options: dict[str, list[Any]] = {}
        for name, multiples in self.multiples.items():
            unit = 1.0 if name == "added_mass" else getattr(self.rig.follower, name).si
            options[name] = [float(f"{unit * multiple:.3g}") for multiple in multiples]
        return options

    @cached_property
    def setups(self) -> list[LabSetup]:
        """All set-ups of the sheet."""
        combinations = product(*self.options.values())
        return [LabSetup(**dict(zip(self.options, c, strict=True))) for c in combinations]

    @property
    def answerable_setups(self) -> list[LabSetup]:
        """Set-ups that have an answer.

        They have no cam, because cams are only compared.
        """
        return list(dict.fromkeys(replace(setup, cam=None) for setup in self.setups))

    def true_rig(self, setup: LabSetup, seed: str | None) -> RigConfig:
        """Return the rig of a set-up with its true numbers.

        If `seed` is None, they are the numbers on the sheet.
        """

        def factor(kind: str, option: float) -> float:
            if seed is None or kind not in self.tolerances:
                return 1.0
            return hidden_factor(self.name, seed, f"{kind} {option:.6g}", self.tolerances[kind])

        follower = self.rig.follower
        spring, preload = setup.spring_stiffness, setup.preload
        spring = follower.spring_stiffness.si if spring is None else spring
        preload = follower.preload.si if preload is None else preload
        numbers = {
            "spring_stiffness": spring * factor("spring_stiffness", spring),
            # the follower and each weight have different factors
            "mass": follower.mass.si * factor("mass", 0.0)
            + (added := setup.added_mass or 0.0) * factor("mass", added),
            "preload": preload * factor("preload", preload),
            "damping": follower.damping.si * factor("damping", 0.0),
        }
        if follower.stem_damping is not None:
            numbers["stem_damping"] = follower.stem_damping.si * factor("damping", 1.0)
        if follower.stem_stiffness is not None:
            numbers["stem_stiffness"] = follower.stem_stiffness.si * factor("stem_stiffness", 0.0)
        return self.rig.with_follower(**numbers)

    @classmethod
    def columns(cls) -> tuple[str, ...]:
        """Return the headings of the columns in the sheet's file."""
        setup_columns = [COLUMNS[name] for name in cls.choices()]
        value_columns = [column for column in (cls.measured, cls.answer) if column]
        return ("reading", *setup_columns, "speed_rpm", *value_columns)

    @classmethod
    def choices(cls) -> tuple[str, ...]:
        """Return the fields of `LabSetup` that a student can choose."""
        return (*cls.multiples, *(["cam"] if cls.default_other_cam else []))

    @property
    @abstractmethod
    def knob(self) -> Span:
        """Range of the speed knob (rpm), computed from the numbers on the sheet."""

    @abstractmethod
    def true(self, setup: LabSetup) -> float:
        """Return the true answer of a set-up, in `unit`."""

    @abstractmethod
    def turn(self, setup: LabSetup, rpm: float, number: int) -> LabTurn:
        """Return the observed turn of a set-up at a speed (rpm).

        `number` is the number of the reading on the sheet, on which the scatter of an instrument
        depends.
        """

    @property
    @abstractmethod
    def plot(self) -> tuple[Span, Span]:
        """Ranges of x and y in the plot of the readings.

        The y axis points up.
        """

    @abstractmethod
    def point(self, reading: LabReading) -> tuple[float, float]:
        """Return the position of a reading in the plot, x and y."""

    @abstractmethod
    def theory(self) -> list[FloatArray]:
        """Return the theoretical curves of the plot, by the numbers on the sheet.

        They are evaluated at `CURVE_POINTS` equal steps of x. There is one curve per marker, or one
        for all.
        """


#: Name of the column of a file for each field of a set-up.
COLUMNS = {
    "spring_stiffness": "spring_N_m",
    "added_mass": "added_mass_kg",
    "preload": "preload_N",
    "cam": "cam",
}
#: Number of points of the theoretical curve over the whole axis, including its ends.
CURVE_POINTS = 401
