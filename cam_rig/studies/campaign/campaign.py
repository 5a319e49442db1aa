"""Reading and checking of a campaign, and measurement of its points.

A campaign measures the same quantities for many rigs. A point is one of these rigs: a combination
of values of the inputs, which are the varied numbers.
"""

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
from cam_rig.quantities.catalogue import QUANTITIES, campaign_quantities
from cam_rig.quantities.steady import scene_at
from cam_rig.quantities.terms import Limit, Term, parse_limit, parse_term
from cam_rig.quantities.values import Subject
from cam_rig.schema import CamConfig, Library, RigConfig, SceneConfig, load_cam, load_rig
from cam_rig.schema.explain import validate_data
from cam_rig.schema.load import is_path, load, load_scene, quantity_data
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

#: Sample rate (Hz) of simulated motions if the campaign has no scene.
SAMPLE_RATE = 48_000
#: Number of turns simulated at each speed if the campaign has no scene.
TURNS = 4
#: Number of first turns at each speed that are not evaluated, if the campaign has no scene.
TRANSIENT_TURNS = 1
#: Path of the campaign input that is the amplitude of a waviness of the cam profile.
WAVE = "profile.waviness.amplitude"
#: Path of the campaign input that is the wavelength of a waviness of the cam profile.
WAVELENGTH = "profile.waviness.wavelength"
#: Speed (rpm) in the schedule of the scene that is created if the campaign names none. It has no
#: effect, because each measure is computed at the speed in its name.
SPEED_RPM = 300.0


@dataclass(frozen=True)
class CampaignMeasure:
    """Quantity that a campaign measures for each rig, with its column in the dataset."""

    term: Term

    @property
    def column(self) -> str:
        """Name of the column in the dataset, such as ``lift_offs_at_450rpm``.

        It ends with the unit if the unit is not SI.
        """
        name = re.sub(r"\W+", "_", self.term.key.replace("@", "_at_"))
        return name + {"rpm": "_rpm", "dB": "_db"}.get(self.unit, "")

    @property
    def unit(self) -> str:
        """Unit in the dataset: SI, except for speeds in rpm and levels in dB."""
        quantity = self.term.quantity
        return quantity.unit if quantity.unit in ("rpm", "dB") else quantity.si

    @property
    def factor(self) -> float:
        """SI value of the unit of the dataset. Values in SI are divided by it."""
        return self.term.quantity.units[self.unit]

    def compute(self, point: Subject) -> float:
        """Return the value of the measure for one rig, in the unit of the dataset.

        ``point`` is the rig with its cam and scene.
        """
        return self.term.quantity.value(point, self.term, "<=") / self.factor


def parse_measures(texts: Iterable[str], model: str) -> tuple[CampaignMeasure, ...]:
    """Parse the measures of a campaign, such as ``lift_offs@450rpm``.

    ``model`` is the dynamic model of the scene, which decides what can be measured.

    Raises
    ------
    ConfigError
        If a measure is unknown, repeated, or not possible at its speed.
    """
    measures: list[CampaignMeasure] = []
    for text in texts:
        term = parse_term(text, campaign_quantities(model))
        quantity = term.quantity
        if term.low < term.high and not quantity.ranges:
            range_quantities = ", ".join(name for name, q in QUANTITIES.items() if q.ranges)
            raise ConfigError(
                f"{term.key} must be at one speed; use one measure per speed (ranges are possible "
                f"for {range_quantities})"
            )
        if quantity.where == "rpm" and not MIN_SPEED <= term.low <= term.high <= MAX_SPEED:
            raise ConfigError(
                f"{term.key}: the speed must be between {MIN_SPEED / RPM:g} and "
                f"{format_number(MAX_SPEED / RPM)} rpm"
            )
        if CampaignMeasure(term) in measures:
            raise ConfigError(f"measures: {term.key} is repeated; remove one")
        measures.append(CampaignMeasure(term))
    return tuple(measures)


def parse_limits(
    texts: Iterable[str], measures: tuple[CampaignMeasure, ...], model: str
) -> tuple[Limit, ...]:
    """Parse the limits of a campaign, such as ``jump_speed>=400rpm``.

    Each limit must be on one of ``measures``, the quantities that the campaign measures. ``model``
    is the dynamic model of the scene.

    Raises
    ------
    ConfigError
        If a limit has no value, or its quantity is not measured.
    """
    terms = [measure.term for measure in measures]
    limits = tuple(parse_limit(text, campaign_quantities(model)) for text in texts)
    for limit in limits:
        if limit.value is None:
            raise ConfigError(
                f"limit on {limit.term.key} must be a number with its unit, got start"
            )
        if limit.term not in terms:
            raise ConfigError(
                f"a limit must be on one of the measures {', '.join(term.key for term in terms)}, "
                f"got {limit.term.key}"
            )
    return limits


def satisfies(limit: Limit, values: FloatArray) -> NDArray[np.bool_]:
    """Return a mask that is True for each value that satisfies a limit.

    The values are those of the limit's measure, in the unit of the dataset. NaN does not satisfy a
    limit.
    """
    assert limit.value is not None  # checked by `parse_limits`
    bound = limit.value / CampaignMeasure(limit.term).factor
    return values <= bound if limit.sense == "<=" else values >= bound


@dataclass(eq=False)
class Campaign:
    """Checked campaign: many rigs (points) that differ in some numbers.

    It contains the cam, the rig and the scene on which the points are based, the ``inputs`` (varied
    numbers), the ``measures``, the ``limits`` and the ``draws`` (input values of all points).
    ``total`` is the number of points.
    """

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
        paths = paths_of(configs)
        self.inputs = tuple(input_of(path, v, paths) for path, v in config.vary.items())
        self.draws = InputDraws(config, self.inputs)
        self.total, self.seed = self.draws.total, config.plan.seed

    def __reduce__(self) -> tuple[type[Campaign], tuple[object, ...]]:
        """Return the data for pickling: the configurations only.

        A worker process computes the other attributes from them.
        """
        return Campaign, (self.config, self.cam, self.rig, self.scene)

    @cached_property
    def text(self) -> str:
        """JSON text of all data on which the rows depend, to detect a changed campaign."""
        parts = {key: getattr(self, key) for key in ("config", "cam", "rig", "scene")}
        dumped = {key: x.model_dump(mode="json", exclude_none=True) for key, x in parts.items()}
        return json.dumps(dumped, sort_keys=True, separators=(",", ":"))

    @property
    def fingerprint(self) -> str:
        """SHA-256 digest of `text`, which identifies the campaign in its dataset."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def with_plan(self, points: int | None = None, seed: int | None = None) -> Campaign:
        """Return the campaign with another number of points (rigs) or another random seed.

        None keeps the value of the campaign.
        """
        if points is None and seed is None:
            return self
        changes = {"points": points, "seed": seed}
        data = self.config.model_dump(exclude_none=True)
        data["plan"] |= {key: value for key, value in changes.items() if value is not None}
        return _check(replace(self, config=validate_data(CampaignConfig, data)))


def campaign_from(data: Mapping[str, Any], library: Library) -> Campaign:
    """Create a campaign from plain data with the structure of a campaign file.

    The files that it names are searched for in ``library``.
    """
    return _campaign(validate_data(CampaignConfig, data), library)


def open_campaign(path: Path) -> Campaign:
    """Read a campaign file and the files that it names.

    These are in the folders next to it, or shipped with cam_rig.
    """
    config = load(path, CampaignConfig)
    try:
        return _campaign(config, Library.for_scene(path))
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def _campaign(config: CampaignConfig, library: Library) -> Campaign:
    base, scene = config.base, None
    name, rig_name = base.cam, base.rig
    if base.scene is not None:
        scene_path = library.file("scenes", base.scene)
        scene = load_scene(scene_path)
        if is_path(base.scene):  # names in a scene file refer to the folders next to it
            library = Library.for_scene(scene_path)
        name, rig_name = base.cam or scene.cams[0], scene.rig
        if name not in scene.cams:
            raise ConfigError(
                f"base.cam must be a cam of scene {scene.name} ({', '.join(scene.cams)}), got "
                f"{name!r}"
            )
    assert name is not None and rig_name is not None  # ensured by the schema
    cam_path = library.file("cams", name)
    cam, rig = load_cam(cam_path), load_rig(library.file("rigs", rig_name))
    require_sprung(cam_path, cam)
    scene = (scene or _scene(cam, rig, base.model)).model_copy(update={"cams": [cam.name]})
    return _check(Campaign(config, cam, rig, scene))


def _check(campaign: Campaign) -> Campaign:
    """Return the campaign, or raise a `ConfigError` if it is inconsistent.

    For example, a waviness without wavelength, a speed that the scene cannot run, or too many
    points are errors.
    """
    if WAVE in campaign.config.vary and WAVELENGTH not in campaign.config.vary:
        raise ConfigError(f"vary.{WAVE} requires {WAVELENGTH}")
    for item in campaign.inputs:
        if item.path == WAVELENGTH:
            for wavelength in ends_of(item).tolist():
                require_wavelength(wavelength)
    if not any(item.path.startswith("scene.") for item in campaign.inputs):
        for term in (item.term for item in campaign.measures if item.term.quantity.of_run):
            try:  # the scene may not allow this speed, at any point
                scene_at(campaign.scene, term.low)
            except ConfigError as error:
                raise ConfigError(f"{term.key}: {error}") from None
    if campaign.total > MAX_POINTS:
        raise ConfigError(
            f"the plan may have at most {format_number(MAX_POINTS)} points, got "
            f"{format_number(campaign.total)}; use several campaigns, each with its own seed and "
            "folder"
        )
    return campaign


def _scene(cam: CamConfig, rig: RigConfig, model: str | None) -> SceneConfig:
    """Return a scene for a campaign whose base is only a cam and a rig.

    ``model`` is its dynamic model. If it is None, the model is two masses if the rig defines how
    its mass is split, otherwise one mass.
    """
    number = partial(quantity_data, "assumed", source="campaign")
    follower = rig.follower
    split = None not in (follower.roller_share, follower.stem_stiffness, follower.stem_damping)
    schedule = {
        "speeds": number([SPEED_RPM], "rpm"),
        "turns": number(TURNS, "turns"),
        "transient_turns": number(TRANSIENT_TURNS, "turns"),
    }
    head = {"name": "campaign", "title": cam.title, "cams": [cam.name], "rig": rig.name}
    run = {"model": model or ("two_mass" if split else "one_mass"), "schedule": schedule}
    sampling = {"sample_rate": number(SAMPLE_RATE, "Hz")}
    return SceneConfig.model_validate(head | run | sampling)


#: Status of a point (one rig of the campaign) whose measures are all computed from a steady motion.
OK = "ok"
#: Status of a point (one rig of the campaign) for which at least one measure could not be computed.
#: The column ``reason`` contains the error.
FAILED = "failed"
#: Status of a point (one rig of the campaign) whose simulated motion did not become steady. The
#: column ``reason`` names the turns that were measured.
UNSETTLED = "unsettled"


@dataclass(frozen=True, eq=False)
class BatchRows(Batch):
    """Results of consecutive points (rigs) of a campaign.

    ``inputs`` are ``(n, d)`` in SI. ``measures`` are ``(n, k)`` in the units of their columns, NaN
    if a measure failed. ``reasons`` are n texts, empty if all measures are from a steady motion.
    """

    inputs: FloatArray
    measures: FloatArray
    reasons: tuple[str, ...]

    @property
    def status(self) -> list[str]:
        """Status of each point (rig) in a batch: ``ok``, ``failed`` or ``unsettled``."""
        failed = np.asarray(np.isnan(self.measures).any(axis=1))
        return [
            FAILED if is_failed else UNSETTLED if reason else OK
            for is_failed, reason in zip(failed, self.reasons, strict=True)
        ]


def measure_batch(campaign: Campaign, first: int, last: int) -> BatchRows:
    """Measure the points ``first`` to ``last`` (exclusive) of a campaign.

    A point is one rig with its input values. Its results depend only on its index and the campaign,
    not on the batch.
    """
    return batch_task(campaign, first, last)()


def batch_task(campaign: Campaign, first: int, last: int) -> partial[BatchRows]:
    """Return the task of `measure_batch` for a worker process.

    It contains the input values, so that a worker does not import the libraries that draw them.
    """
    return partial(_measure_inputs, campaign, first, campaign.draws.rows(first, last))


def _measure_inputs(campaign: Campaign, first: int, inputs: FloatArray) -> BatchRows:
    """Measure consecutive points from ``first`` on, with the input values ``(n, d)`` in SI."""
    start, last = time.process_time(), first + len(inputs)
    rows = [measure_point(campaign, row) for row in inputs]
    measures = np.array([values for values, _ in rows]).reshape(len(rows), -1)
    reasons = tuple(reason for _, reason in rows)
    return BatchRows(first, last, time.process_time() - start, inputs, measures, reasons)


def measure_point(campaign: Campaign, inputs: FloatArray) -> tuple[list[float], str]:
    """Return the measures of one point, and the reason of a failure as text.

    ``inputs`` ``(d,)`` are the input values of the point in SI. A failed measure is NaN. The text
    is empty if every measure is computed from a steady motion.
    """
    try:
        point = make_point(campaign, inputs)
    except CamRigError as error:
        return [math.nan] * len(campaign.measures), str(error)
    values, reasons = [], []
    for measure in campaign.measures:
        try:
            values.append(measure.compute(point))
            if unsettled := point.unsteady_note(measure.term):
                reasons.append(unsettled)
        except CamRigError as error:
            values.append(math.nan)
            reasons.append(f"{measure.term.key}: {error}")
    return values, "; ".join(dict.fromkeys(reasons))


def make_point(campaign: Campaign, inputs: FloatArray) -> Subject:
    """Return the cam, rig and scene of one point (one rig of the campaign).

    They are those of the base files, with the input values ``inputs`` ``(d,)``, in SI. Errors of
    the cam profile are added to the law of the cam.
    """
    numbers: dict[str, dict[str, float]] = {"cam": {}, "rig": {}, "scene": {}, "profile": {}}
    for item, value in zip(campaign.inputs, inputs.tolist(), strict=True):
        root, _, path = item.path.partition(".")
        numbers[root][path] = value
    law, cam = campaign.law, with_numbers(campaign.cam, numbers["cam"])
    if numbers["cam"]:
        law = build_law(cam)
    nominal = law
    if numbers["profile"]:
        law = ProfileErrors.of(numbers["profile"]).add_to(law)
    rig = with_numbers(campaign.rig, numbers["rig"])
    scene = with_numbers(campaign.scene, numbers["scene"])
    return Subject(law, rig, cam, scene=scene, nominal=nominal)
