"""A scene's run, computed here or read from a bag: level against speed for each cam."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cam_rig.arguments import checked
from cam_rig.dynamics import Samples
from cam_rig.errors import ConfigError
from cam_rig.extras import libraries_named
from cam_rig.show.result import notebook
from cam_rig.simulation.by_speed import SpeedRow, SpeedRows, rows_by_speed
from cam_rig.simulation.export import export
from cam_rig.simulation.regression import NoiseResult, compare
from cam_rig.simulation.scene import LoadedScene, load_scene
from cam_rig.simulation.schedule import tick_count
from cam_rig.simulation.simulate import (
    MeasuredTick,
    TickSamples,
    require_ticks,
    simulate,
    step_levels,
    turned_ticks,
)
from cam_rig.units import to_rpm

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame


@dataclass(frozen=True, eq=False, repr=False)
class SceneRun:
    """A run of a scene.

    Parameters
    ----------
    loaded : the scene with its cams, laws and rig
    ticks : what the microphone measured, tick by tick: r.m.s. pressure (Pa)
    source : the scene's file, or the bag
    blocks : gives the follower's samples tick by tick, with the cam under them; see `samples`
    counts : messages by topic, of a bag
    speeds : what `by_speed` is made of, where the samples have gone through it already
    """

    loaded: LoadedScene
    ticks: tuple[MeasuredTick, ...]
    source: Path
    blocks: Callable[[], Iterator[TickSamples]]
    counts: dict[str, int] = field(default_factory=dict)
    speeds: SpeedRows | None = None

    def __repr__(self) -> str:
        return f"SceneRun({self.source}: {', '.join(self.loaded.laws)}, {len(self.ticks)} ticks)"

    @property
    def complete(self) -> bool:
        """Whether the whole scene was run."""
        return len(self.ticks) >= tick_count(self.loaded.scene)

    @cached_property
    def noise(self) -> NoiseResult:
        """Level (dB) against speed (rpm): ``curves`` by cam, and where two regressions cross."""
        levels = step_levels(self.ticks, self.loaded.scene.program.settle_turns.si)
        require_ticks(levels, str(self.source))
        return compare(
            levels, {cam: self.loaded.role(cam) for cam in levels}, self.loaded.published
        )

    @checked
    def samples(self, cam: str, rpm: float) -> Samples:
        """The follower's samples of a cam at one speed: ``time``, ``lift``, ``force`` and so on.

        They are read from the bag, or computed again.

        Examples
        --------
        >>> import cam_rig
        >>> samples = cam_rig.read_bag("bags/golden").samples("tm21", 400)
        >>> round(float(samples.force.max()), 1)  # N
        114.0
        """
        found = [tick.rows for tick in self.blocks() if tick.is_of(cam, rpm)]
        if not found:
            there = {f"{t.start.cam} at {to_rpm(t.start.speed):g} rpm": None for t in self.ticks}
            raise ConfigError(f"samples: {cam} at {rpm:g} rpm; allowed: {', '.join(there)}")
        joined = np.hstack(found)
        joined.setflags(write=False)
        return Samples(joined)

    @cached_property
    def by_speed(self) -> tuple[SpeedRow, ...]:
        """A row each cam and speed: level, forces, lift-offs, landings, torque; settled turns.

        Examples
        --------
        >>> import cam_rig
        >>> for row in cam_rig.read_bag("bags/golden").by_speed[2:4]:
        ...     print(row.cam, row.rpm, round(row.force_peak, 1), round(row.lift_offs, 6))
        tm21 350.0 92.8 1.0
        tm21 400.0 114.0 1.0
        """
        scene = self.loaded.scene
        rate, settle = int(scene.sample_rate.si), scene.program.settle_turns.si
        levels = step_levels(self.ticks, settle)
        require_ticks(levels, str(self.source))
        if self.speeds is not None:
            return self.speeds.rows(levels)
        return rows_by_speed(self.blocks(), self.loaded.laws, rate, settle, levels)

    @checked
    def export(self, path: str | Path, *, cam: str | None = None, rpm: float | None = None) -> None:
        """Write every sample with θ, rpm and cam beside it, as ``cam-rig export`` does.

        Parameters
        ----------
        path : .parquet, .csv, .npz or .wav; columns ``time_s``, ``cam``, ``rpm``, ``angle_rad``,
            ``angle_in_turn_rad``, ``lift_m``, ``velocity_m_s``, ``acceleration_m_s2``,
            ``force_N``, ``impulse_N_s``
        cam, rpm : only this cam, only this speed

        Examples
        --------
        >>> import cam_rig, numpy as np
        >>> cam_rig.read_bag("bags/golden").export("out/golden.npz", cam="tm21")
        >>> with np.load("out/golden.npz") as table:
        ...     print(table["cam"][0], table["rpm"][0].round(), table["force_N"].size)
        tm21 200.0 1643
        """
        export(Path(path), self.blocks(), self.loaded, cam, rpm)

    def to_pandas(self) -> DataFrame:
        """A row each cam and speed, as `by_speed`: ``cam``, ``rpm``, ``level_db`` and so on."""
        with libraries_named():
            from pandas import DataFrame
        return DataFrame([row.plain() for row in self.by_speed])

    def plot(self) -> Figure:
        """Level (dB) against speed (rpm), with regressions and what is published."""
        with libraries_named():
            from cam_rig.simulation.figures import figure
        return notebook(figure(self.noise, self.loaded))


@checked
def run_scene(
    scene: str | Path | LoadedScene, *, on_tick: Callable[[], None] = lambda: None
) -> SceneRun:
    """Run a scene without ROS: the same core as the nodes, and the same numbers.

    Parameters
    ----------
    scene : a name in ``config/scenes``, a path, or what `load_scene` gave
    on_tick : called after each tick, for a progress bar

    Raises
    ------
    ConfigError, LawError : one line that names the file and what is wrong in it

    Examples
    --------
    >>> import cam_rig
    >>> run = cam_rig.run_scene("quick")
    >>> curve = run.noise.curves["bezier15"]
    >>> curve.rpm.round(), curve.level_db.round(1)
    (array([200., 300., 350., 400.]), array([78.5, 81.4, 83.2, 85.4]))
    """
    loaded = scene if isinstance(scene, LoadedScene) else load_scene(scene)
    rate, settle = loaded.scene.sample_rate.si, loaded.scene.program.settle_turns.si
    speeds, ticks = SpeedRows(loaded.laws, int(rate), settle), []
    for tick in simulate(loaded, speeds.take):
        ticks.append(tick)
        on_tick()
    again = partial(turned_ticks, loaded)
    return SceneRun(loaded, tuple(ticks), loaded.scene_file, again, speeds=speeds)
