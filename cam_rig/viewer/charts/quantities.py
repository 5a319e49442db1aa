"""The quantities of a run that are drawn over the turn, and how far each goes in a scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import MODELS
from cam_rig.dynamics.samples import NamedRows
from cam_rig.laws import Law
from cam_rig.schema import SceneConfig
from cam_rig.schema.quantity import Quantity
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.simulate import turned_ticks
from cam_rig.viewer.charts import series
from cam_rig.viewer.charts.axes import round_range
from cam_rig.viewer.charts.series import SeriesLine
from cam_rig.viewer.charts.shaft_twist import TORSIONAL, ShaftTwist

#: From and to, and step, of an axis, in the unit shown.
Range = tuple[float, float, float]
Ranges = Mapping[str, Range]


@dataclass(frozen=True)
class Drawn:
    """A quantity with its title and its curve, whose ``factor`` takes SI to the unit shown."""

    key: str
    title: str
    line: SeriesLine


LIFT = Drawn("lift", "Lift [mm]", series.LIFT)
VELOCITY = Drawn("velocity", "Velocity [m/s]", series.VELOCITY)
ACCELERATION = Drawn("acceleration", "Acceleration [m/s²]", series.ACCELERATION)
FORCE = Drawn("force", "Contact force [N]", series.FORCE)
GAP = Drawn("gap", "Gap [µm]", series.GAP)
TWIST = Drawn("twist", "Twist of the shaft [°]", series.TWIST)


#: Turns at each speed, at most, that the axes of a scene are found from.
MAX_TURNS = 50
#: Key of the axis on which the smallest of a scene's gaps can be seen beside its greatest.
CLOSE_GAP = "close_gap"
#: A gap (µm) that is worth an axis of its own, that axis over it, and over the axis of all gaps.
MIN_GAP, CLOSE, MAX_SHARE = 1.0, 4.0, 0.2


def drawn_of(model: str) -> tuple[Drawn, ...]:
    """What is drawn of a model: the gap where it can leave the cam, the twist of a shaft.

    Examples
    --------
    >>> [row.key for row in drawn_of("one_mass")]
    ['lift', 'velocity', 'acceleration', 'force', 'gap']
    """
    more = [GAP] if MODELS[model].lifts_off else [TWIST] if model == TORSIONAL else []
    return LIFT, VELOCITY, ACCELERATION, FORCE, *more


def gap_of(law: Law, angle: FloatArray, rows: NamedRows) -> FloatArray:
    """``(n,)`` how far (m) a follower is off its cam at cam ``angle`` (rad); 0 in contact."""
    return np.where(rows.force == 0.0, rows.lift - law(angle), 0.0)


@dataclass(frozen=True)
class SceneRanges:
    """The axis of each quantity by its key: over all cams, and of each cam by its name."""

    whole: Ranges
    by_cam: Mapping[str, Ranges]

    def of(self, cam: str) -> Ranges:
        """A cam's own; of one that the scene does not name, those over all."""
        return self.by_cam.get(cam, self.whole)


def scene_ranges(loaded: LoadedScene) -> SceneRanges:
    """Axes from the least and the greatest of each quantity, at all speeds of the scene.

    The scene is solved for it, as it runs: it takes a few tenths of a second. Of a long scene, the
    first turns at each speed, in which what the step of speed set off dies away.
    """
    loaded = replace(loaded, scene=_shortened(loaded.scene))
    rows = drawn_of(loaded.scene.model)
    shaft = ShaftTwist(loaded) if TWIST in rows else None
    ends: dict[str, FloatArray] = {}
    gaps: dict[tuple[str, float], float] = {}
    for tick in turned_ticks(loaded):
        values = [*tick.motion, tick.force]
        if GAP in rows:
            values.append(gap := gap_of(loaded.laws[tick.cam], tick.angle, tick))
            step = tick.cam, tick.interval.speed
            gaps[step] = max(gaps.get(step, 0.0), float(gap.max()))
        if shaft is not None:
            values.append(shaft.tick(tick.cam, tick.interval, tick.time))
        now = np.array([[row.min(), row.max()] for row in values])
        ends[tick.cam] = _wider(ends.get(tick.cam, now), now)
    whole = reduce(_wider, ends.values())
    by_cam = {cam: _ranges(rows, values) for cam, values in ends.items()}
    return SceneRanges({**_ranges(rows, whole), **close_gap([*gaps.values()])}, by_cam)


def _shortened(scene: SceneConfig) -> SceneConfig:
    """A scene with no more turns than are looked at."""
    program = scene.program
    if program.turns.si <= MAX_TURNS:
        return scene
    turns = Quantity(assumed=float(MAX_TURNS), unit="turns", source="what the axes are drawn for")
    settle = Quantity(assumed=0.0, unit="turns", source="as turns")
    short = program.model_copy(update={"turns": turns, "settle_turns": settle})
    return scene.model_copy(update={"program": short})


def close_gap(gaps: Sequence[float]) -> Ranges:
    """The axis of the smallest gap (m) of any speed, where it is lost on that of all; else none."""
    seen = [gap * GAP.line.factor for gap in gaps if gap * GAP.line.factor >= MIN_GAP]
    if not seen or CLOSE * min(seen) > MAX_SHARE * max(seen):
        return {}
    return {CLOSE_GAP: round_range(0.0, CLOSE * min(seen))}


def _wider(one: FloatArray, other: FloatArray) -> FloatArray:
    """``(k, 2)`` ends of both."""
    low, high = np.minimum(one, other), np.maximum(one, other)
    return np.column_stack([low[:, 0], high[:, 1]])


def _ranges(rows: Sequence[Drawn], ends: FloatArray) -> dict[str, Range]:
    """Round axes that show 0 too, of ``(k, 2)`` ends, SI."""
    shown = {}
    for row, (low, high) in zip(rows, ends.tolist(), strict=True):
        factor = row.line.factor
        shown[row.key] = round_range(min(low, 0.0) * factor, max(high, 0.0) * factor)
    return shown
