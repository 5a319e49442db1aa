"""A study with its base read and everything checked; it goes to the workers as it is."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from cam_rig.campaigns.draws import InputDraws, ends_of
from cam_rig.campaigns.inputs import CampaignInput, input_of, paths_of, require_wavelength
from cam_rig.campaigns.measures import CampaignMeasure, parse_limits, parse_measures, require_runs
from cam_rig.campaigns.schema import MAX_POINTS, CampaignConfig, load_campaign
from cam_rig.errors import ConfigError
from cam_rig.law_design.terms import Limit
from cam_rig.laws import Law, build_law
from cam_rig.laws.cam import require_sprung
from cam_rig.schema import CamConfig, Library, RigConfig, SceneConfig, load_cam, load_rig
from cam_rig.schema.explain import explain
from cam_rig.schema.load import is_path, load_scene
from cam_rig.show.tables import number

#: Runs of a base without a scene: samples a second, turns and those left out.
SAMPLE_RATE, TURNS, SETTLE_TURNS = 48_000, 4, 1

#: A waviness has both.
WAVE, WAVELENGTH = "profile.waviness.amplitude", "profile.waviness.wavelength"

#: Any speed: each measure has its own.
SPEED_RPM = 300.0


@dataclass(frozen=True, eq=False)
class Campaign:
    """A study on its base: what varies, what is measured, and how points are run."""

    config: CampaignConfig
    cam: CamConfig
    rig: RigConfig
    scene: SceneConfig

    def __reduce__(self) -> tuple[type[Campaign], tuple[object, ...]]:
        """What goes to a worker: the files; the rest is made of them there."""
        return Campaign, (self.config, self.cam, self.rig, self.scene)

    @cached_property
    def draws(self) -> InputDraws:
        """The inputs of all points."""
        return InputDraws.of(self.config, self.inputs)

    @cached_property
    def inputs(self) -> tuple[CampaignInput, ...]:
        """What varies."""
        configs: dict[str, Any] = {"cam": self.cam, "rig": self.rig}
        if self.config.base.scene is not None:
            configs["scene"] = self.scene
        known = paths_of(configs)
        return tuple(input_of(path, one, known) for path, one in self.config.vary.items())

    @cached_property
    def measures(self) -> tuple[CampaignMeasure, ...]:
        """What is measured."""
        return parse_measures(self.config.measures, self.scene.model)

    @cached_property
    def limits(self) -> tuple[Limit, ...]:
        """What the measures are to keep."""
        return parse_limits(self.config.limits, self.measures, self.scene.model)

    @cached_property
    def law(self) -> Law:
        """The base's law."""
        return build_law(self.cam)

    @property
    def total(self) -> int:
        """Points of the plan."""
        return self.draws.total

    @property
    def seed(self) -> int:
        """Of the plan."""
        return self.config.plan.seed

    @cached_property
    def text(self) -> str:
        """The study and its base as JSON: what a row depends on, beside its index."""
        parts = {key: getattr(self, key) for key in ("config", "cam", "rig", "scene")}
        dumped = {key: one.model_dump(mode="json", exclude_none=True) for key, one in parts.items()}
        return json.dumps(dumped, sort_keys=True, separators=(",", ":"))

    @property
    def fingerprint(self) -> str:
        """SHA-256 of `text`."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def planned(self, points: int | None = None, seed: int | None = None) -> Campaign:
        """The same with other points or another seed."""
        if points is None and seed is None:
            return self
        given = {"points": points, "seed": seed}
        data = self.config.model_dump(exclude_none=True)
        data["plan"] |= {key: value for key, value in given.items() if value is not None}
        return checked(replace(self, config=_validated(data)))


def _validated(data: Mapping[str, Any]) -> CampaignConfig:
    try:
        return CampaignConfig.model_validate(data)
    except ValidationError as error:
        raise ConfigError(explain(error, CampaignConfig)) from None


def campaign_from(data: Mapping[str, Any], library: Library) -> Campaign:
    """A study from plain data, as a file holds it."""
    return campaign_of(_validated(data), library)


def open_campaign(path: Path) -> Campaign:
    """Read a study and the files it names: of its own folders, or shipped ones."""
    config, library = load_campaign(path), Library.beside(path)
    try:
        return campaign_of(config, library)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def campaign_of(config: CampaignConfig, library: Library) -> Campaign:
    """A study on its base."""
    base = config.base
    scene = None
    if base.scene is not None:
        scene_path = library.file("scenes", base.scene)
        scene = load_scene(scene_path)
        if is_path(base.scene):  # then the names in it are of its own folders
            library = Library.beside(scene_path)
    if scene is not None and base.cam is not None and base.cam not in scene.cams:
        raise ConfigError(
            f"base.cam: is {base.cam!r}; allowed: a cam of scene {scene.name}: "
            f"{', '.join(scene.cams)}"
        )
    name, rig_name = base.cam, base.rig
    if scene is not None:
        name, rig_name = base.cam or scene.cams[0], scene.rig
    assert name is not None and rig_name is not None  # the schema's
    cam_path = library.file("cams", name)
    cam, rig = load_cam(cam_path), load_rig(library.file("rigs", rig_name))
    require_sprung(cam_path, cam)
    if scene is None:
        scene = _scene(cam, rig, base.model)
    scene = scene.model_copy(update={"cams": [cam.name]})
    return checked(Campaign(config, cam, rig, scene))


def checked(campaign: Campaign) -> Campaign:
    """A study whose parts fit together."""
    _ = campaign.limits, campaign.law
    if WAVE in campaign.config.vary and WAVELENGTH not in campaign.config.vary:
        raise ConfigError(f"vary.{WAVE}: has no wavelength; needed beside it: {WAVELENGTH}")
    for one in campaign.inputs:
        if one.path == WAVELENGTH:
            for wavelength in ends_of(one).tolist():
                require_wavelength(wavelength)
    if not any(one.path.startswith("scene.") for one in campaign.inputs):
        require_runs(campaign.measures, campaign.scene)
    if campaign.total > MAX_POINTS:
        raise ConfigError(
            f"plan: has {number(campaign.total)} points; allowed: up to {number(MAX_POINTS)}; "
            "remedy: several campaigns, each with a seed and a folder of its own"
        )
    return campaign


def _scene(cam: CamConfig, rig: RigConfig, model: str | None) -> SceneConfig:
    """How points are run where the base is no scene."""
    f = rig.follower
    split = None not in (f.roller_share, f.stem_stiffness, f.stem_damping)

    def number(value: object, unit: str) -> dict[str, object]:
        return {"assumed": value, "unit": unit, "source": "campaign"}

    return SceneConfig.model_validate(
        {
            "name": "campaign",
            "title": cam.title,
            "cams": [cam.name],
            "rig": rig.name,
            "model": model or ("two_mass" if split else "one_mass"),
            "sample_rate": number(SAMPLE_RATE, "Hz"),
            "program": {
                "speeds": number([SPEED_RPM], "rpm"),
                "turns": number(TURNS, "turns"),
                "settle_turns": number(SETTLE_TURNS, "turns"),
            },
        }
    )
