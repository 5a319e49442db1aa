"""How the rig is set up: cam, model and the follower's numbers, as a scene that nodes can run."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import yaml

from cam_rig import dynamics
from cam_rig.dynamics import TwoMassParameters
from cam_rig.errors import ConfigError, RefusedError
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import NAME, config_root
from cam_rig.studies.jump.any_rig import follower_of

#: Models that a bench runs, and what a rig must have for each.
TWO_MASS = "two_mass"
MODELS = ("one_mass", TWO_MASS, "kinetostatic", "elastic_stem", "torsional")
#: A scene's last speed (rpm): what the viewer's axes have room for.
DRAWN_RPM = 600.0
SPEEDS_ARE = "the knob's first, and what the axes have room for"
#: The speed (rpm) that the knob begins at.
START_RPM = 200.0
#: Ticks of a turn: a command acts at the next one, 17 ms later at 300 rpm.
TICKS_PER_TURN = 12
#: Samples a second (Hz): what the page's sound and the recorded force are made of.
SAMPLE_RATE = 4000
#: Speeds (rpm) that are taken: a tick has two samples at the highest.
MIN_RPM, MAX_RPM = 1.0, 60.0 * SAMPLE_RATE / (2 * TICKS_PER_TURN)
#: Turns after which a bench ends by itself: 5 h at 300 rpm.
MAX_TURNS = 100_000
#: What is added to the rig's own mass (kg), at most.
MAX_ADDED_MASS = 100.0


@dataclass(frozen=True)
class Setup:
    """What is chosen while the machine stands.

    Parameters
    ----------
    cam : name of the cam that is mounted first
    model : one of `MODELS`
    added_mass : on the follower's own, kg
    spring_stiffness : N/m
    preload : N
    rpm : of the cam, until another speed is commanded
    """

    cam: str
    model: str
    added_mass: float
    spring_stiffness: float
    preload: float
    rpm: float = START_RPM

    @classmethod
    def of(cls, rig: RigConfig, cam: str) -> Setup:
        """The rig as its file has it: two masses where it says how its mass is split, else one.

        Raises
        ------
        ConfigError : it splits its mass only half
        """
        own, two = rig.follower, isinstance(follower_of(rig), TwoMassParameters)
        model = TWO_MASS if two else MODELS[0]
        return cls(cam, model, 0.0, own.spring_stiffness.si, own.preload.si)

    def changed(self, given: dict[str, Any], rig: RigConfig) -> Setup:
        """The set-up with what a page has chosen.

        Raises
        ------
        RefusedError : a value of another kind, a model that the rig has no numbers for, or numbers
            out of range
        """
        known = asdict(self)
        wrong = [key for key in given if key not in known]
        kinds = {key: str if isinstance(value, str) else float for key, value in known.items()}
        try:
            values: dict[str, Any] = {k: kinds[k](given.get(k, v)) for k, v in known.items()}
            found = Setup(**values)
        except (TypeError, ValueError, OverflowError):
            wrong = [key for key in given if key in known]
        if wrong:
            raise RefusedError(f"set-up: {', '.join(wrong)[:80]}: allowed: {', '.join(known)}")
        if found.model not in allowed_models(rig):
            allowed = ", ".join(allowed_models(rig))
            raise RefusedError(f"model: is {found.model[:40]!r}; allowed on this rig: {allowed}")
        if not MIN_RPM <= found.rpm <= MAX_RPM:
            raise RefusedError(f"rpm: is {found.rpm:g}; allowed: {MIN_RPM:g} to {MAX_RPM:g}")
        if not 0.0 <= found.added_mass <= MAX_ADDED_MASS:
            raise RefusedError(
                f"added mass: is {found.added_mass:g} kg; allowed: 0 to {MAX_ADDED_MASS:g}"
            )
        found.rig(rig)
        return found

    def rig(self, base: RigConfig) -> RigConfig:
        """The rig with the chosen numbers; those that are the file's own keep their origin.

        Raises
        ------
        RefusedError : a number out of range
        """
        own = {
            "mass": base.follower.mass.si + self.added_mass,
            "spring_stiffness": self.spring_stiffness,
            "preload": self.preload,
        }
        other = {k: v for k, v in own.items() if v != getattr(base.follower, k).si}
        try:
            return base.with_follower(**other) if other else base
        except ConfigError as error:
            raise RefusedError(str(error)) from None

    def write(self, folder: Path, base: RigConfig) -> Path:
        """Write scene and rig into a folder, beside its ``cams``; gives the scene's path."""
        speeds = [self.rpm] if self.rpm >= DRAWN_RPM else [self.rpm, DRAWN_RPM]
        rig = self.rig(base).model_dump(exclude_none=True, mode="json") | {"name": "bench"}
        scene = {
            "name": "bench",
            "title": f"The bench, {base.title}",
            "cams": [self.cam],
            "rig": "bench",
            "model": self.model,
            "sample_rate": {"assumed": SAMPLE_RATE, "unit": "Hz", "source": "the bench's"},
            "program": {
                "speeds": {"assumed": speeds, "unit": "rpm", "source": SPEEDS_ARE},
                "turns": {"assumed": MAX_TURNS, "unit": "turns", "source": "until it is ended"},
                "settle_turns": {"assumed": 1, "unit": "turns", "source": "the bench's"},
                "ticks_per_turn": TICKS_PER_TURN,
            },
        }
        for kind, data in (("scenes", scene), ("rigs", rig)):
            (folder / kind).mkdir(parents=True, exist_ok=True)
            text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True)
            (folder / kind / "bench.yaml").write_text(text, encoding="utf-8")
        return folder / "scenes" / "bench.yaml"


def allowed_models(rig: RigConfig) -> tuple[str, ...]:
    """The models that a rig has the numbers for."""

    def known(model: str) -> bool:
        try:
            dynamics.MODELS[model].parameters(rig)
        except ConfigError:
            return False
        return True

    return tuple(model for model in MODELS if known(model))


def cam_names(own: Path) -> list[str]:
    """The cams that can be mounted: the bench's own, and the shipped ones."""
    folders = (own, config_root() / "cams")
    found = {path.stem for folder in folders for path in folder.glob("*.yaml")}
    return sorted(name for name in found if NAME.fullmatch(name))


def add_cam(cam: CamConfig, cams: Path) -> None:
    """Put a cam among those that can be mounted."""
    data = cam.model_dump(exclude_none=True, mode="json")
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True)
    cams.mkdir(parents=True, exist_ok=True)
    (cams / f"{cam.name}.yaml").write_text(text, encoding="utf-8")
