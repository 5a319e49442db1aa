"""A lab sheet: what it asks for, the set-ups that there are for it, and the rig behind it."""

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
from cam_rig.files import shown
from cam_rig.laws import Law, build_law
from cam_rig.laws.cam import require_sprung
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.units import FloatArray

#: A seed is part of a file's name.
SEED_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")
#: The knob begins and ends at these parts of the least and the greatest speed that one expects.
KNOB_FROM, KNOB_TO = 0.5, 1.25


@dataclass(frozen=True)
class LabSetup:
    """Spring (N/m), added mass (kg), preload (N), cam's name; None: as the lab has it."""

    spring_stiffness: float | None = None
    added_mass: float | None = None
    preload: float | None = None
    cam: str | None = None


@dataclass(frozen=True)
class LabReading:
    """A row of a sheet: its number from 1 on, the set-up by the sheet, and the speed (rpm).

    Beside the speed what an instrument showed, where the lab has one. Where what is asked is not
    itself read, a row has the ``answer`` alone.
    """

    number: int
    setup: LabSetup
    rpm: float | None = None
    measured: float | None = None
    answer: float | None = None


@dataclass(frozen=True, eq=False)
class LabTurn:
    """A turn of the steady state as it is observed at a speed.

    ``curve`` has points at equal steps of the cam angle from 0 on, as its sensor resolves them;
    ``sound`` is of full scale, to be repeated; ``measured`` is what the lab's instrument shows.
    ``was_lost``: contact was lost on the way up to this speed. Empty where nothing can be seen.
    """

    contact_lost: bool
    was_lost: bool
    curve: FloatArray = field(default_factory=lambda: np.empty(0))
    sound: FloatArray = field(default_factory=lambda: np.empty(0))
    measured: float | None = None


#: From and to, of a knob or an axis.
Span = tuple[float, float]


def drawn(lab: str, seed: str, number: str, tolerance: float) -> float:
    """The factor on a number: in 1 ± ``tolerance``, evenly, the same for the same words."""
    data = hashlib.sha256(f"cam_rig\n{lab}\n{seed}\n{number}".encode()).digest()
    return 1.0 + tolerance * (2.0 * int.from_bytes(data[:8], "big") / (2**64 - 1) - 1.0)


@dataclass(frozen=True, eq=False)
class LabSheet(ABC):
    """The frame of every lab: one or two cams, a rig; ``seed`` names the rig that is measured."""

    name: ClassVar[str]
    #: What can be set up: fields of `LabSetup`, and the parts of the rig's own number that there
    #: are; of the added mass kg.
    parts: ClassVar[Mapping[str, tuple[float, ...]]] = {}
    #: By which part the hidden rig's numbers may differ from those on the sheet, either way.
    tolerances: ClassVar[Mapping[str, float]]
    #: Column of what an instrument shows beside the speed.
    measured: ClassVar[str | None] = None
    #: What is asked for, its unit, and its column where it is not the speed that is read.
    asked: ClassVar[str]
    unit: ClassVar[str]
    answer: ClassVar[str | None] = None
    #: How the true value is defined, in a sentence.
    truth: ClassVar[str]
    #: By how much (%) an answer may be off, if nothing else is said.
    within: ClassVar[float] = 1.0
    #: The set-up's field that has a marker each, and the one whose second value fills it.
    marker: ClassVar[str] = "added_mass"
    filled: ClassVar[str | None] = None
    #: Whether a turn has a sound.
    heard: ClassVar[bool] = True
    #: The cam that is compared with the sheet's, if no other is named.
    beside: ClassVar[str | None] = None

    cam: CamConfig
    rig: RigConfig
    seed: str | None = None
    other: CamConfig | None = None

    def __post_init__(self) -> None:
        if self.seed is not None and not SEED_NAME.fullmatch(self.seed):
            raise ConfigError(
                f"--seed: is {shown(self.seed)}; allowed: a name of 1 to 40 letters, digits, - and "
                "_"
            )
        for cam in self.cams.values():
            require_sprung(Path(cam.name), cam)

    @cached_property
    def cams(self) -> dict[str, CamConfig]:
        """The sheet's cams by their names."""
        return {cam.name: cam for cam in (self.cam, self.other) if cam is not None}

    @cached_property
    def laws(self) -> dict[str, Law]:
        """Their laws."""
        return {name: build_law(cam) for name, cam in self.cams.items()}

    @property
    def law(self) -> Law:
        """The first cam's."""
        return self.laws[self.cam.name]

    @cached_property
    def options(self) -> dict[str, list[Any]]:
        """What can be chosen, by the field of `LabSetup`; to three digits as a catalogue has it."""
        own = self.rig.follower
        found: dict[str, list[Any]] = {}
        for name, parts in self.parts.items():
            unit = 1.0 if name == "added_mass" else getattr(own, name).si
            found[name] = [float(f"{unit * part:.3g}") for part in parts]
        return found

    @cached_property
    def setups(self) -> list[LabSetup]:
        """Every set-up that there is."""
        every = product(*self.options.values())
        return [LabSetup(**dict(zip(self.options, values, strict=True))) for values in every]

    @property
    def asked_setups(self) -> list[LabSetup]:
        """Those that an answer may be of: cams are compared, and not asked about."""
        return list(dict.fromkeys(replace(setup, cam=None) for setup in self.setups))

    def true_rig(self, setup: LabSetup, seed: str | None) -> RigConfig:
        """The rig as it is set up, with its true numbers; no seed: the sheet's own."""

        def factor(kind: str, which: float) -> float:
            if seed is None or kind not in self.tolerances:
                return 1.0
            return drawn(self.name, seed, f"{kind} {which:.6g}", self.tolerances[kind])

        own = self.rig.follower
        spring, preload = setup.spring_stiffness, setup.preload
        spring = own.spring_stiffness.si if spring is None else spring
        preload = own.preload.si if preload is None else preload
        numbers = {
            "spring_stiffness": spring * factor("spring_stiffness", spring),
            # the follower, and each weight, is a body of its own
            "mass": own.mass.si * factor("mass", 0.0)
            + (added := setup.added_mass or 0.0) * factor("mass", added),
            "preload": preload * factor("preload", preload),
            "damping": own.damping.si * factor("damping", 0.0),
        }
        if own.stem_damping is not None:
            numbers["stem_damping"] = own.stem_damping.si * factor("damping", 1.0)
        if own.stem_stiffness is not None:
            numbers["stem_stiffness"] = own.stem_stiffness.si * factor("stem_stiffness", 0.0)
        return self.rig.with_follower(**numbers)

    @classmethod
    def columns(cls) -> tuple[str, ...]:
        """Of the sheet's file."""
        own = [COLUMNS[name] for name in cls.choices()]
        more = [column for column in (cls.measured, cls.answer) if column]
        return ("reading", *own, "speed_rpm", *more)

    @classmethod
    def choices(cls) -> tuple[str, ...]:
        """Fields of `LabSetup` that can be chosen."""
        return (*cls.parts, *(["cam"] if cls.beside else []))

    @property
    @abstractmethod
    def knob(self) -> Span:
        """Speeds (rpm) of the knob, by the sheet's numbers."""

    @abstractmethod
    def true(self, setup: LabSetup) -> float:
        """The true answer of a set-up, in ``unit``."""

    @abstractmethod
    def turn(self, setup: LabSetup, rpm: float, number: int) -> LabTurn:
        """What is seen of a set-up at a speed (rpm) while the reading of a number is taken."""

    @property
    @abstractmethod
    def plot(self) -> tuple[Span, Span]:
        """Where x and y of the readings' plot begin and end; y grows with what is drawn."""

    @abstractmethod
    def point(self, reading: LabReading) -> tuple[float, float]:
        """Where a reading is in the plot."""

    @abstractmethod
    def theory(self) -> list[FloatArray]:
        """Curves at `CURVE` equal steps of x by the sheet's numbers, one a marker or for all."""


#: Fields of a set-up as columns of a file.
COLUMNS = {
    "spring_stiffness": "spring_N_m",
    "added_mass": "added_mass_kg",
    "preload": "preload_N",
    "cam": "cam",
}
#: Points of a curve of theory over the whole axis, its ends among them.
CURVE = 401
