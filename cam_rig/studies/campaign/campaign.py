"""A study with its base read and everything checked, and its points: what fails is a row too."""

from __future__ import annotations

import hashlib
import json
import math
import re
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cam_rig.datasets.point_files import Batch
from cam_rig.errors import CamRigError, ConfigError
from cam_rig.laws import build_law
from cam_rig.laws.cam import require_sprung
from cam_rig.quantities.catalogue import QUANTITIES, measured_in
from cam_rig.quantities.steady import scene_at
from cam_rig.quantities.terms import Limit, Term, parse_limit, parse_term
from cam_rig.quantities.values import Subject
from cam_rig.schema import CamConfig, Library, RigConfig, SceneConfig, load_cam, load_rig
from cam_rig.schema.explain import validated
from cam_rig.schema.load import is_path, load, load_scene, quantity
from cam_rig.schema.scene import MAX_SPEED, MIN_SPEED
from cam_rig.show.tables import format_number
from cam_rig.studies.campaign.draws import InputDraws, ends_of
from cam_rig.studies.campaign.inputs import (
    ProfileErrors,
    input_of,
    paths_of,
    require_wavelength,
    with_numbers,
)
from cam_rig.studies.campaign.schema import MAX_POINTS, CampaignConfig
from cam_rig.units import RPM, FloatArray

#: Runs of a base without a scene: samples a second, turns and those left out.
SAMPLE_RATE, TURNS, SETTLE_TURNS = 48_000, 4, 1
#: A waviness has both.
WAVE, WAVELENGTH = "profile.waviness.amplitude", "profile.waviness.wavelength"
#: Any speed: each measure has its own.
SPEED_RPM = 300.0


@dataclass(frozen=True)
class CampaignMeasure:
    """One measure of a study, and where it stands in rows."""

    term: Term

    @property
    def column(self) -> str:
        """A plain name, ``lift_offs_at_450rpm``; with the unit where that is not SI."""
        words = re.sub(r"\W+", "_", self.term.key.replace("@", "_at_"))
        return words + {"rpm": "_rpm", "dB": "_db"}.get(self.unit, "")

    @property
    def unit(self) -> str:
        """Unit in rows: SI, but for speeds in rpm and levels in dB."""
        quantity = self.term.quantity
        return quantity.unit if quantity.unit in ("rpm", "dB") else quantity.si

    @property
    def factor(self) -> float:
        """One of that unit in SI."""
        return self.term.quantity.units[self.unit]

    def of(self, point: Subject) -> float:
        """The measure of a point, in its unit in rows."""
        return self.term.quantity.value(point, self.term, "<=") / self.factor


def parse_measures(texts: Iterable[str], model: str) -> tuple[CampaignMeasure, ...]:
    """The measures of a study whose scene has a model."""
    found: list[CampaignMeasure] = []
    for text in texts:
        term = parse_term(text, measured_in(model))
        quantity = term.quantity
        if term.low < term.high and not quantity.ranges:
            over = ", ".join(name for name, one in QUANTITIES.items() if one.ranges)
            raise ConfigError(
                f"{term.key}: is a range; allowed: one speed, a measure for each (a range for "
                f"{over})"
            )
        if quantity.where == "rpm" and not MIN_SPEED <= term.low <= term.high <= MAX_SPEED:
            raise ConfigError(
                f"{term.key}: no model takes this speed; allowed: {MIN_SPEED / RPM:g} to "
                f"{format_number(MAX_SPEED / RPM)} rpm"
            )
        if CampaignMeasure(term) in found:
            raise ConfigError(f"measures: {term.key} stands twice; allowed: each once")
        found.append(CampaignMeasure(term))
    return tuple(found)


def parse_limits(
    texts: Iterable[str], measures: tuple[CampaignMeasure, ...], model: str
) -> tuple[Limit, ...]:
    """The limits of a study, on its measures."""
    terms = [one.term for one in measures]
    found = tuple(parse_limit(text, measured_in(model)) for text in texts)
    for limit in found:
        if limit.value is None:
            raise ConfigError(f"limit on {limit.term.key}: start; allowed: a number and its unit")
        if limit.term not in terms:
            raise ConfigError(
                f"limit on {limit.term.key}: is not measured; allowed: a limit on "
                f"{', '.join(term.key for term in terms)}"
            )
    return found


def kept(limit: Limit, values: FloatArray) -> NDArray[np.bool_]:
    """Which values of its measure, in its unit in rows, keep a limit; NaN does not."""
    assert limit.value is not None  # checked as the study was opened
    bound = limit.value / CampaignMeasure(limit.term).factor
    return values <= bound if limit.sense == "<=" else values >= bound


@dataclass(eq=False)
class Campaign:
    """A study on its base: what varies, what is measured, and how points are run."""

    config: CampaignConfig
    cam: CamConfig
    rig: RigConfig
    scene: SceneConfig

    def __post_init__(self) -> None:
        config, model = self.config, self.scene.model
        self.measures = parse_measures(config.measures, model)
        self.limits = parse_limits(config.limits, self.measures, model)
        self.law = build_law(self.cam)
        configs: dict[str, Any] = {"cam": self.cam, "rig": self.rig}
        if config.base.scene is not None:
            configs["scene"] = self.scene
        known = paths_of(configs)
        self.inputs = tuple(input_of(path, one, known) for path, one in config.vary.items())
        self.draws = InputDraws(config, self.inputs)
        self.total, self.seed = self.draws.total, config.plan.seed

    def __reduce__(self) -> tuple[type[Campaign], tuple[object, ...]]:
        """What goes to a worker: the files; the rest is made of them there."""
        return Campaign, (self.config, self.cam, self.rig, self.scene)

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
        return _checked(replace(self, config=validated(CampaignConfig, data)))


def campaign_from(data: Mapping[str, Any], library: Library) -> Campaign:
    """A study from plain data, as a file holds it."""
    return _campaign(validated(CampaignConfig, data), library)


def open_campaign(path: Path) -> Campaign:
    """Read a study and the files it names: of its own folders, or shipped ones."""
    config = load(path, CampaignConfig)
    try:
        return _campaign(config, Library.beside(path))
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def _campaign(config: CampaignConfig, library: Library) -> Campaign:
    base, scene = config.base, None
    name, rig_name = base.cam, base.rig
    if base.scene is not None:
        scene_path = library.file("scenes", base.scene)
        scene = load_scene(scene_path)
        if is_path(base.scene):  # then the names in it are of its own folders
            library = Library.beside(scene_path)
        name, rig_name = base.cam or scene.cams[0], scene.rig
        if name not in scene.cams:
            raise ConfigError(
                f"base.cam: is {name!r}; allowed: a cam of scene {scene.name}: "
                f"{', '.join(scene.cams)}"
            )
    assert name is not None and rig_name is not None  # the schema's
    cam_path = library.file("cams", name)
    cam, rig = load_cam(cam_path), load_rig(library.file("rigs", rig_name))
    require_sprung(cam_path, cam)
    scene = (scene or _scene(cam, rig, base.model)).model_copy(update={"cams": [cam.name]})
    return _checked(Campaign(config, cam, rig, scene))


def _checked(campaign: Campaign) -> Campaign:
    """A study whose parts fit together."""
    if WAVE in campaign.config.vary and WAVELENGTH not in campaign.config.vary:
        raise ConfigError(f"vary.{WAVE}: has no wavelength; needed beside it: {WAVELENGTH}")
    for one in campaign.inputs:
        if one.path == WAVELENGTH:
            for wavelength in ends_of(one).tolist():
                require_wavelength(wavelength)
    if not any(one.path.startswith("scene.") for one in campaign.inputs):
        for term in (one.term for one in campaign.measures if one.term.quantity.of_run):
            try:  # a speed at which the scene cannot turn, whatever the point
                scene_at(campaign.scene, term.low)
            except ConfigError as error:
                raise ConfigError(f"{term.key}: {error}") from None
    if campaign.total > MAX_POINTS:
        raise ConfigError(
            f"plan: has {format_number(campaign.total)} points; allowed: up to "
            f"{format_number(MAX_POINTS)}; remedy: several campaigns, each with a seed and a "
            "folder of its own"
        )
    return campaign


def _scene(cam: CamConfig, rig: RigConfig, model: str | None) -> SceneConfig:
    """How points are run where the base is no scene."""
    number = partial(quantity, "assumed", source="campaign")
    follower = rig.follower
    split = None not in (follower.roller_share, follower.stem_stiffness, follower.stem_damping)
    program = {
        "speeds": number([SPEED_RPM], "rpm"),
        "turns": number(TURNS, "turns"),
        "settle_turns": number(SETTLE_TURNS, "turns"),
    }
    head = {"name": "campaign", "title": cam.title, "cams": [cam.name], "rig": rig.name}
    how = {"model": model or ("two_mass" if split else "one_mass"), "program": program}
    rate = {"sample_rate": number(SAMPLE_RATE, "Hz")}
    return SceneConfig.model_validate(head | how | rate)


#: Status of a point: all measures are there, or a reason says why not, or of which turns they are.
OK, FAILED, UNSETTLED = "ok", "failed", "unsettled"


@dataclass(frozen=True, eq=False)
class BatchRows(Batch):
    """``inputs`` ``(n, d)`` SI and ``measures`` ``(n, k)`` in their columns' units, NaN for none.

    A reason is empty where nothing failed and all has settled.
    """

    inputs: FloatArray
    measures: FloatArray
    reasons: tuple[str, ...]

    @property
    def status(self) -> list[str]:
        """One a row."""
        failed = np.asarray(np.isnan(self.measures).any(axis=1))
        return [
            FAILED if bad else UNSETTLED if reason else OK
            for bad, reason in zip(failed, self.reasons, strict=True)
        ]


def measure_batch(campaign: Campaign, first: int, last: int) -> BatchRows:
    """The rows of points ``first`` to ``last`` (exclusive), each from its index and the study."""
    start = time.process_time()
    inputs = campaign.draws.rows(first, last)
    rows = [measure_point(campaign, row) for row in inputs]
    measures = np.array([values for values, _ in rows]).reshape(len(rows), -1)
    reasons = tuple(reason for _, reason in rows)
    return BatchRows(first, last, time.process_time() - start, inputs, measures, reasons)


def measure_point(campaign: Campaign, inputs: FloatArray) -> tuple[list[float], str]:
    """The measures of one point, and why some are missing."""
    try:
        point = make_point(campaign, inputs)
    except CamRigError as error:
        return [math.nan] * len(campaign.measures), str(error)
    found, reasons = [], []
    for measure in campaign.measures:
        try:
            found.append(measure.of(point))
            if unsettled := point.unsettled(measure.term):
                reasons.append(unsettled)
        except CamRigError as error:
            found.append(math.nan)
            reasons.append(f"{measure.term.key}: {error}")
    return found, "; ".join(dict.fromkeys(reasons))


def make_point(campaign: Campaign, inputs: FloatArray) -> Subject:
    """The cam, the rig and the scene with a point's numbers ``(d,)``, SI."""
    numbers: dict[str, dict[str, float]] = {"cam": {}, "rig": {}, "scene": {}, "profile": {}}
    for one, value in zip(campaign.inputs, inputs.tolist(), strict=True):
        root, _, path = one.path.partition(".")
        numbers[root][path] = value
    law, cam = campaign.law, with_numbers(campaign.cam, numbers["cam"])
    if numbers["cam"]:
        law = build_law(cam)
    nominal = law
    if numbers["profile"]:
        law = ProfileErrors.of(numbers["profile"]).added_to(law)
    rig = with_numbers(campaign.rig, numbers["rig"])
    scene = with_numbers(campaign.scene, numbers["scene"])
    return Subject(law, rig, cam, scene=scene, nominal=nominal)
