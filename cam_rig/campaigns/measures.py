"""What is measured of every point: one table, each entry calling what the rig has for it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from cam_rig.campaigns.steady import MOST_TURNS, SETTLED, steady_row
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.any_follower import AnyFollower, find_jump, follower_of
from cam_rig.dynamics.jump.jump_speed import FROM_REST
from cam_rig.dynamics.jump.search import NoJumpSpeedError, sought_speed
from cam_rig.dynamics.kinetostatic import force_extremes
from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.dynamics.vibration import residual_vibration, steady_twist
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.law_design.terms import QUANTITIES, DesignQuantity, Limit, Term, parse_limit
from cam_rig.law_design.terms import parse_term as parse
from cam_rig.laws import Law
from cam_rig.schema import RigConfig, SceneConfig
from cam_rig.schema.explain import explain
from cam_rig.schema.quantity import Quantity
from cam_rig.schema.scene import MAX_SPEED, MIN_SPEED
from cam_rig.show.tables import number
from cam_rig.simulation.by_speed import SpeedRow
from cam_rig.units import RPM, FloatArray

#: Speeds of a range over which residual vibration is largest.
SPEEDS = 41


@dataclass(frozen=True, eq=False)
class MeasuredPoint:
    """One cam on one rig; ``scene`` says how it is run where a measure needs a motion."""

    law: Law
    rig: RigConfig
    scene: SceneConfig
    _runs: dict[float, tuple[SpeedRow, bool]] = field(default_factory=dict)

    def run(self, speed: float) -> SpeedRow:
        """The settled turns at one speed (rad/s), run once for all measures of them."""
        if speed not in self._runs:
            scene = scene_at(self.scene, speed)
            self._runs[speed] = steady_row(self.law, self.rig, scene, speed)
        return self._runs[speed][0]

    def unsettled(self, term: Term) -> str:
        """Which turns a measure is of whose follower never settles; empty for any other."""
        if term.name not in OF_RUNS or self._runs[term.low][1]:
            return ""
        return (
            f"at {term.low / RPM:.6g} rpm not settled to {SETTLED:g} in {MOST_TURNS} turns, so of "
            f"the {self.scene.program.turns.si - self.scene.program.settle_turns.si:g} after them"
        )


def scene_at(scene: SceneConfig, speed: float) -> SceneConfig:
    """A scene whose program holds one speed (rad/s)."""
    speeds = Quantity(assumed=[speed / RPM], unit="rpm")
    program = scene.program.model_copy(update={"speeds": speeds})
    data = scene.model_copy(update={"program": program}).model_dump(exclude_none=True)
    try:
        return SceneConfig.model_validate(data)
    except ValidationError as error:
        raise ConfigError(explain(error, SceneConfig)) from None


def _jump(
    duration: float | None, follower: Callable[[RigConfig], AnyFollower] = follower_of
) -> Callable[[MeasuredPoint, Term], float]:
    """The jump speed of a run from rest of so many s, or in steady state (None).

    Of two masses it is what `cam-rig jump` proves afterwards, to 5e-7.
    """

    def found(point: MeasuredPoint, _: Term) -> float:
        parameters = follower(point.rig)
        if point.law.velocity_jumps:  # where the velocity jumps down the follower lifts off
            return 0.0
        try:
            if isinstance(parameters, TwoMassParameters):
                return sought_speed(point.law, parameters, duration)
            return find_jump(point.law, parameters, duration).speed
        except NoJumpSpeedError as none:
            return none.speed

    return found


def _residual(point: MeasuredPoint, term: Term) -> float:
    count = 1 if term.low == term.high else SPEEDS
    speeds = np.linspace(term.low, term.high, count)
    follower = FollowerParameters.on_stem(point.rig, f"the measure {term.name}")
    return float(residual_vibration(point.law, follower, speeds).max())


def _twist(point: MeasuredPoint, term: Term) -> float:
    return float(np.ptp(steady_twist(point.law, shaft_of(point.rig), term.low)[1]))


def _level(point: MeasuredPoint, term: Term) -> float:
    point.rig.need_radiation(f"the measure {term.name}")
    level = point.run(term.low).level_db
    if level is None:
        raise DynamicsError(f"{term.key}: no settled turn to measure")
    return level


def _rigid_force(point: MeasuredPoint, term: Term) -> float:
    follower = FollowerParameters.from_rig(point.rig)
    least, largest = force_extremes(point.law, follower, term.low)
    return largest if term.name == "peak_contact_force_rigid" else least


def _of_run(name: str) -> Callable[[MeasuredPoint, Term], float]:
    return lambda point, term: float(getattr(point.run(term.low), name))


_TORQUE, _FORCE = {"N*m": 1.0}, {"N": 1.0, "kN": 1e3}

_MICROMETRES = {"um": 1e-6, "µm": 1e-6, "mm": 1e-3, "m": 1.0}


def _either(name: str) -> DesignQuantity:
    """A quantity of designs, which a campaign may limit on either side."""
    q = QUANTITIES[name]
    return DesignQuantity(q.title, q.unit, q.units, q.where, ("<=", ">="), below=q.below)


def _new(title: str, unit: str, units: dict[str, float]) -> DesignQuantity:
    return DesignQuantity(title, unit, units, "rpm", ("<=", ">="))


#: Every measure: what it is, and how it is had of a point, SI (a level in dB).
MEASURES: dict[str, tuple[DesignQuantity, Callable[[MeasuredPoint, Term], float]]] = {
    "jump_speed": (_either("jump_speed"), _jump(FROM_REST)),
    "jump_speed_steady": (_either("jump_speed_steady"), _jump(None)),
    "jump_speed_rigid": (_either("jump_speed_rigid"), _jump(None, FollowerParameters.from_rig)),
    "residual_vibration_steady": (
        _new("residual vibration of a mass on its stem in steady state", "um", _MICROMETRES),
        _residual,
    ),
    "least_contact_force_rigid": (_either("least_contact_force_rigid"), _rigid_force),
    "peak_contact_force_rigid": (_either("peak_contact_force_rigid"), _rigid_force),
    "least_contact_force": (_new("least contact force", "N", _FORCE), _of_run("force_least")),
    "peak_contact_force": (_new("peak contact force", "N", _FORCE), _of_run("force_peak")),
    "sound_level": (_new("sound level", "dB", {"dB": 1.0}), _level),
    "peak_torque": (_new("peak torque", "N*m", _TORQUE), _of_run("torque_peak")),
    "lift_offs": (_new("lift-offs a turn", "", {"": 1.0}), _of_run("lift_offs")),
    "twist": (_new("twist, peak to peak", "rad", {"rad": 1.0, "deg": np.pi / 180.0}), _twist),
}

#: What may be taken over a range of speeds.
OVER_RANGES = ("residual_vibration_steady",)

#: What is taken of a run of the scene.
OF_RUNS = ("least_contact_force", "peak_contact_force", "sound_level", "peak_torque", "lift_offs")

#: What moves in each model of a scene, as titles say it.
MOVES = {
    "kinetostatic": "one rigid mass held on the cam",
    "one_mass": "one rigid mass",
    "elastic_stem": "a mass on its stem held on the cam",
    "two_mass": "two masses",
    "torsional": "a rigid mass on a twisting shaft",
}


@cache
def known_in(model: str) -> Mapping[str, DesignQuantity]:
    """The quantities of a campaign whose scene has a model; what is of its runs says so."""
    return MappingProxyType(
        {
            name: replace(one, title=f"{one.title} of {MOVES[model]}") if name in OF_RUNS else one
            for name, (one, _) in MEASURES.items()
        }
    )


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
        if quantity.unit in ("rpm", "dB"):
            return quantity.unit
        return next(unit for unit, factor in quantity.units.items() if factor == 1.0)

    @property
    def factor(self) -> float:
        """One of that unit in SI."""
        return self.term.quantity.units[self.unit]

    def of(self, point: MeasuredPoint) -> float:
        """The measure of a point, in its unit in rows."""
        return MEASURES[self.term.name][1](point, self.term) / self.factor


def parse_measures(texts: Iterable[str], model: str) -> tuple[CampaignMeasure, ...]:
    """The measures of a study whose scene has a model."""
    found = tuple(CampaignMeasure(_single(parse(text, known_in(model)))) for text in texts)
    for i, one in enumerate(found):
        if one in found[:i]:
            raise ConfigError(f"measures: {one.term.key} stands twice; allowed: each once")
    return found


def _single(term: Term) -> Term:
    if term.low < term.high and term.name not in OVER_RANGES:
        raise ConfigError(
            f"{term.key}: is a range; allowed: one speed, a measure for each (a range for "
            f"{', '.join(OVER_RANGES)})"
        )
    if term.quantity.where == "rpm" and not MIN_SPEED <= term.low <= term.high <= MAX_SPEED:
        raise ConfigError(
            f"{term.key}: no model takes this speed; allowed: {MIN_SPEED / RPM:g} to "
            f"{number(MAX_SPEED / RPM)} rpm"
        )
    return term


def require_runs(measures: Iterable[CampaignMeasure], scene: SceneConfig) -> None:
    """Refuse a measure whose speed the scene cannot turn at, whatever the point."""
    for one in measures:
        if one.term.name in OF_RUNS:
            try:
                scene_at(scene, one.term.low)
            except ConfigError as error:
                raise ConfigError(f"{one.term.key}: {error}") from None


def kept(limit: Limit, values: FloatArray) -> NDArray[np.bool_]:
    """Which values of its measure, in its unit in rows, keep a limit; NaN does not."""
    assert limit.value is not None  # checked as the study was opened
    bound = limit.value / CampaignMeasure(limit.term).factor
    return values <= bound if limit.sense == "<=" else values >= bound


def parse_limits(
    texts: Iterable[str], measures: tuple[CampaignMeasure, ...], model: str
) -> tuple[Limit, ...]:
    """The limits of a study, on its measures."""
    terms = {one.term for one in measures}
    found = tuple(parse_limit(text, known_in(model)) for text in texts)
    for limit in found:
        if limit.value is None:
            raise ConfigError(f"limit on {limit.term.key}: start; allowed: a number and its unit")
        if limit.term not in terms:
            raise ConfigError(
                f"limit on {limit.term.key}: is not measured; allowed: a limit on "
                f"{', '.join(one.term.key for one in measures)}"
            )
    return found
