"""Result of running a scene, simulated or read from a bag, and its tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from operator import itemgetter
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from cam_rig.arguments import check_arguments
from cam_rig.dynamics import Samples
from cam_rig.dynamics.jump.any_follower import describe_run, follower_of
from cam_rig.dynamics.jump.two_masses import REST_DURATION_S
from cam_rig.errors import ConfigError
from cam_rig.show.result import (
    NULL_PROGRESS,
    Column,
    Footnote,
    Progress,
    Records,
    Result,
    subject_line,
)
from cam_rig.simulation.by_speed import SpeedRow, SpeedRows
from cam_rig.simulation.export import export
from cam_rig.simulation.inputs import Cams, Rig, Speeds, resolve_cams, resolve_scene, resolve_speeds
from cam_rig.simulation.regression import MIN_SPEEDS, NoiseCurve, NoiseResult, compare
from cam_rig.simulation.scene import RELATIVE_NOTE, LevelOrigin, LoadedScene
from cam_rig.simulation.schedule import tick_count
from cam_rig.simulation.simulate import (
    MeasuredTick,
    TickSamples,
    require_ticks,
    simulate,
    simulate_ticks,
    step_levels,
)
from cam_rig.studies.simulate.motion import scene_of
from cam_rig.studies.simulate.summary import SUMMARY, CamSummary, summarise
from cam_rig.units import to_rpm

#: Largest number of rows by speed that are displayed if `SceneRun.show_table` is False.
MAX_SHOWN_ROWS = 12
#: Columns of the table of one row per cam and speed, see `SpeedRow`.
SPEEDS = (
    Column("cam"),
    Column("rpm", "rpm", ".6g", "speed"),
    Column("turns", doc="settled turns with samples", hidden=True),
    Column("level", "dB", ".1f", of="level_db", doc="re 20 µPa, unweighted"),
    Column("peak_force", "N", ".1f", "peak force", doc="of the samples"),
    Column("min_force", "N", ".1f", "least force", doc="of the samples"),
    Column("lift_offs", "1/turn", ".3g", "lift-off rate"),
    Column("flight", "ms", ".2f", "longest flight"),
    Column("landing", "N·s", ".3f", "fastest landing"),
    Column("peak_torque", "N·m", ".2f", "peak torque", doc="of the samples"),
    Column("min_torque", "N·m", ".2f", "least torque", doc="of the samples"),
    Column("torque_mean", "N·m", ".3f", "mean torque"),
)


#: Note below the table for rows whose follower is never at rest on the cam, and thus has no contact
#: force.
BOUNCING = Footnote(
    "The follower bounces without end and is never at rest on the cam, so no sample has a contact "
    "force, only the impulses of landings.",
    lambda row: bool(row.peak_force == 0.0),
    "*",
)


def _regression(curve: NoiseCurve) -> str:
    c0, c1, c2, c3 = curve.coefficients
    if not math.isfinite(c0):
        return "needs four speeds"
    return f"{c0:.5g} {c1:+.5g} x {c2:+.5g} x² {c3:+.5g} x³"


def _role(curve: NoiseCurve) -> str:
    """Return the origin of a cam's sound level for the table of noise.

    It is empty unless the level is compared with a published regression, or is relative.
    """
    return "" if curve.rmse_db is None and curve.role is not LevelOrigin.RELATIVE else curve.role


def _coefficient(power: int) -> Column:
    unit = ("dB", "dB/rpm", "dB/rpm²", "dB/rpm³")[power]
    of: Any = lambda curve: curve.coefficients[power]  # noqa: E731
    doc = f"of level over speed, times rpm^{power}"
    if power:
        return Column(f"c{power}", unit, of=of, doc=doc, hidden=True)
    return Column("c0", unit, heading="regression", of=of, cell=_regression, doc=doc)


@dataclass(frozen=True, eq=False, repr=False)
class SceneRun(Result):
    """Run of a scene, simulated or recorded.

    A tick is the time between two published states of the cam, one turn by default.

    Parameters
    ----------
    loaded : LoadedScene
        Scene with its cams, laws and rig.
    ticks : tuple of MeasuredTick
        Measurements of the microphone: the r.m.s. pressure (Pa) of each tick.
    source : Path
        Scene file or bag.
    blocks : callable
        Function that returns an iterator over the samples of each tick, see also `samples`.
    counts : dict of str to int
        Number of messages by topic, empty for a simulated run.
    speeds : SpeedRows, optional
        Accumulator that has received all samples (default: `by_speed` reads them from `blocks`).
    notes : tuple of str
        Sentences on missing data of a bag, and on possible errors in a recovered bag.
    show_table : bool
        True to display the tables ``speeds`` and ``noise`` of a run with many speeds too.
    """

    schema = "cam_rig.simulate.1"
    plot_function = "cam_rig.studies.simulate.figures:figure"
    columns: ClassVar = {
        "speeds": SPEEDS,
        "summary": SUMMARY,
        "noise": (
            Column("cam"),
            *map(_coefficient, range(4)),
            Column("rms_difference", "dB r.m.s.", ".2f", "difference to published", "rmse_db"),
            Column("role", cell=_role, doc="origin of the level"),
            Column("level_first", "dB", ".1f", "first level", lambda curve: curve.level_db[0]),
            Column("level_last", "dB", ".1f", "last level", lambda curve: curve.level_db[-1]),
        ),
        "levels": (
            Column("cam", of=itemgetter(0)),
            Column("rpm", "rpm", of=itemgetter(1)),
            Column("level", "dB", of=itemgetter(2), doc="of the microphone, re 20 µPa"),
        ),
        "crossing": (
            Column(
                "rpm",
                "rpm",
                of=itemgetter(0),
                doc="speed of equal levels of the two published cams",
            ),
            Column("published_rpm", "rpm", of=itemgetter(1)),
        ),
        "messages": (
            Column("topic", of=itemgetter(0)),
            Column("count", of=itemgetter(1), doc="number of messages in the bag"),
        ),
        "run": (
            Column("complete", doc="true if the whole scene was run"),
            Column("notes", doc="missing data and possible errors of a bag"),
        ),
    }

    loaded: LoadedScene
    ticks: tuple[MeasuredTick, ...]
    source: Path
    blocks: Callable[[], Iterator[TickSamples]]
    counts: dict[str, int] = field(default_factory=dict)
    speeds: SpeedRows | None = None
    notes: tuple[str, ...] = ()
    show_table: bool = False

    def __repr__(self) -> str:
        return f"SceneRun({self.source}: {', '.join(self.loaded.laws)}, {len(self.ticks)} ticks)"

    @property
    def subject(self) -> str:
        """Cams, rig and model of the scene."""
        return subject_line(self.loaded.laws, self.loaded.rig.name, self.loaded.scene.model)

    @property
    def complete(self) -> bool:
        """True if the run contains the whole scene."""
        return len(self.ticks) >= tick_count(self.loaded.scene)

    @cached_property
    def noise(self) -> NoiseResult:
        """Sound levels (dB) of each cam over speed (rpm), with regressions and crossing.

        The field ``curves`` contains the levels by cam. The crossing is the speed at which the two
        cams that the publication names are equally loud.
        """
        roles = {cam: self.loaded.level_origin(cam) for cam in self._levels}
        return compare(self._levels, roles, self.loaded.published)

    @cached_property
    def _levels(self) -> dict[str, dict[float, float]]:
        levels = step_levels(self.ticks, self.loaded.scene.schedule.transient_turns.si)
        if not self.loaded.missing_for_sound:
            require_ticks(levels, str(self.source))
        return levels

    @check_arguments
    def samples(self, cam: str, rpm: float) -> Samples:
        """Return the samples of the follower on a cam at one speed.

        They are read from the bag, or simulated again.

        Parameters
        ----------
        cam : str
            Name of a cam of the scene.
        rpm : float
            Cam speed, rpm.

        Returns
        -------
        Samples
            Arrays ``(n,)`` in SI units: ``time``, ``lift``, ``velocity``, ``acceleration``,
            ``force`` and ``impulse``.

        Raises
        ------
        ConfigError
            If the run does not contain the cam at this speed.

        Examples
        --------
        >>> import cam_rig
        >>> samples = cam_rig.read_bag("bags/golden").samples("tm21", 400)
        >>> round(float(samples.force.max()), 1)  # N
        114.0
        """
        blocks = [tick.rows for tick in self.blocks() if tick.is_of(cam, rpm)]
        if not blocks:
            steps = {f"{t.start.cam} at {to_rpm(t.start.speed):g} rpm": None for t in self.ticks}
            raise ConfigError(
                f"the samples must be of one of {', '.join(steps)}, got {cam} at {rpm:g} rpm"
            )
        rows = np.hstack(blocks)
        rows.setflags(write=False)
        return Samples(rows)

    @cached_property
    def by_speed(self) -> tuple[SpeedRow, ...]:
        """One row per cam and speed: level, forces, lift-offs, landings and torque.

        Only whole settled turns are evaluated.

        Examples
        --------
        >>> import cam_rig
        >>> for row in cam_rig.read_bag("bags/golden").by_speed[2:4]:
        ...     print(row.cam, row.rpm, round(row.peak_force, 1), round(row.lift_offs, 6))
        tm21 350.0 92.8 1.0
        tm21 400.0 114.0 1.0
        """
        levels, speeds = self._levels, self.speeds
        if speeds is None:
            speeds = SpeedRows.of(self.loaded)
            for tick in self.blocks():
                speeds.take(tick)
        return speeds.rows(levels)

    @cached_property
    def summaries(self) -> tuple[CamSummary, ...]:
        """One row per cam: level range, jump speed and first speed with lost contact.

        It is empty for a bag without samples.
        """
        by_cam: dict[str, list[SpeedRow]] = {}
        for row in self.by_speed:
            by_cam.setdefault(row.cam, []).append(row)
        curves, laws, rig = self.noise.curves, self.loaded.laws, self.loaded.rig
        return tuple(
            summarise(rows, curves.get(cam), laws[cam], rig) for cam, rows in by_cam.items()
        )

    @check_arguments
    def export(self, path: str | Path, *, cam: str | None = None, rpm: float | None = None) -> None:
        """Write every sample of the run to a file, with name, speed and angle of the cam.

        The command is ``cam-rig export``.

        Parameters
        ----------
        path : str or Path
            File with the suffix .parquet, .csv, .npz or .wav. Its columns are ``time_s``, ``cam``,
            ``rpm``, ``angle_rad``, ``angle_in_turn_rad``, ``lift_m``, ``velocity_m_s``,
            ``acceleration_m_s2``, ``force_N``, ``impulse_N_s`` and ``torque_N_m``.
        cam : str, optional
            Name of a cam (default: all cams).
        rpm : float, optional
            A cam speed, rpm (default: all speeds and ramps).

        Raises
        ------
        ConfigError
            If the suffix is unknown, or the run has no samples of the cam at the speed.
        OutputError
            If the format cannot contain the samples.

        Examples
        --------
        >>> import cam_rig, numpy as np
        >>> cam_rig.read_bag("bags/golden").export("out/golden.npz", cam="tm21")
        >>> with np.load("out/golden.npz") as table:
        ...     print(table["cam"][0], table["rpm"][0].round(), table["force_N"].size)
        tm21 200.0 1643
        """
        export(Path(path), self.blocks(), self.loaded, cam, rpm)

    def tables(self) -> list[Records]:
        """Return the tables ``speeds``, ``summary`` and ``noise``, and tables for export.

        The table ``speeds`` is empty for a bag without samples. It is displayed up to
        `MAX_SHOWN_ROWS` rows, and the regressions of ``noise`` only if `show_table` is True.
        """
        title, curves = self.loaded.scene.title, self.noise.curves.values()
        rate = int(self.loaded.scene.sample_rate.si)
        note = f"Settled turns, of samples at {rate} Hz: a flight is known to one sample."
        relative = () if self.loaded.calibrated else (RELATIVE_NOTE,)
        levels = [
            (curve.cam, round(rpm, 9), level)
            for curve in curves
            for rpm, level in zip(curve.rpm.tolist(), curve.level_db.tolist(), strict=True)
        ]
        published = self.loaded.published
        crossing = self.noise.crossover_rpm, published and published.crossover.rpm
        is_long = len(self.by_speed) > MAX_SHOWN_ROWS and not self.show_table
        jump = f"Jump speed: {describe_run(follower_of(self.loaded.rig), REST_DURATION_S)}."
        return [
            self.table(
                "speeds", f"{title}: by speed", self.by_speed, note, BOUNCING, hidden=is_long
            ),
            self.table("summary", f"{title}: in short", self.summaries, jump, *relative),
            self.table(
                "noise",
                f"{title}: level over x in rpm",
                curves,
                *relative,
                hidden=not (curves and self.show_table),
            ),
            self.table("levels", "", levels, hidden=True),
            self.table("crossing", "", [crossing], single=True, hidden=True),
            self.table("messages", "", self.counts.items(), hidden=True),
            self.table("run", "", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Return a line on the speed at which two published cams are equally loud.

        The result is empty if the run does not have both cams, or too few speeds for regressions
        and `show_table` is False. It is a note if the run has no sound.
        """
        published = self.loaded.published
        if self.loaded.no_sound_note:
            return [self.loaded.no_sound_note]
        if published is None or not set(published.crossover.between) <= set(self.noise.curves):
            return []
        if not self.show_table and any(c.rpm.size < MIN_SPEEDS for c in self.noise.curves.values()):
            return []
        rpm, names = self.noise.crossover_rpm, " and ".join(published.crossover.between)
        crossing = "none" if rpm is None else f"{rpm:.1f} rpm"
        return [f"{names} cross at {crossing} (published: {published.crossover.rpm:g} rpm)"]


@check_arguments
def run_scene(
    scene: str | Path | LoadedScene,
    rig: Rig = None,
    *,
    on_tick: Callable[[], None] = lambda: None,
) -> SceneRun:
    """Simulate a scene without ROS, with the same results as the nodes.

    The command is ``cam-rig simulate``.

    Parameters
    ----------
    scene : str, Path or LoadedScene
        Name in ``config/scenes``, path, or result of `load_scene`.
    rig : str, Path or Rig, optional
        Name in ``config/rigs``, path, or the rig (default: the scene's).
    on_tick : callable
        Function called after each tick, for a progress bar.

    Returns
    -------
    SceneRun
        Simulated run of the scene.

    Raises
    ------
    ConfigError
        If a file is missing or wrong. The message contains the file and the error.
    LawError
        If the law of a cam cannot be built.

    Examples
    --------
    >>> import cam_rig
    >>> run = cam_rig.run_scene("quick")
    >>> curve = run.noise.curves["bezier15"]
    >>> curve.rpm.round(), curve.level_db.round(1)
    (array([200., 300., 350., 400.]), array([78.5, 81.4, 83.2, 85.4]))
    """
    loaded = resolve_scene(scene, rig)
    speeds, ticks = SpeedRows.of(loaded), []
    for tick in simulate(loaded, speeds.take):
        ticks.append(tick)
        on_tick()
    again = partial(simulate_ticks, loaded)
    return SceneRun(loaded, tuple(ticks), loaded.scene_file, again, speeds=speeds)


@check_arguments
def sweep(
    cams: Cams,
    rig: Rig,
    *,
    rpm: Speeds,
    model: str = "one_mass",
    turns: float = 4.0,
    transient_turns: float = 2.0,
    sample_rate: int = 48_000,
    ramp: float | None = None,
    progress: Progress = NULL_PROGRESS,
) -> SceneRun:
    """Simulate cams at several speeds, one after another.

    It is `run_scene` for arguments instead of a scene file. Without ``radiation`` of the rig, the
    result has no levels.

    Parameters
    ----------
    cams : str, Path, CamConfig, sequence of these, or None
        Names in ``config/cams``, paths or cams (None: the cams of the paper's Table 2).
    rig : str, Path, RigConfig or None
        Name in ``config/rigs``, path or rig (None: the only rig next to the cams).
    rpm : float or sequence of float
        Cam speeds in the order of the run, rpm.
    model : str
        Model of the follower, see `simulate`.
    turns : float
        Number of turns at each speed.
    transient_turns : float
        Number of these turns before the measurement starts.
    sample_rate : int
        Hz.
    ramp : float, optional
        Time of the linear ramp to each speed, s (default: no ramp).
    progress : Progress
        Receiver of the progress.

    Returns
    -------
    SceneRun
        Simulated run of the cams at the speeds.

    Raises
    ------
    ConfigError
        If an argument is out of range, or the rig lacks a number that the model needs.
    DynamicsError
        If the model does not support the law, such as a lift that jumps.

    Examples
    --------
    >>> import cam_rig
    >>> run = cam_rig.sweep("poly345", "tm21", rpm=[300, 450])
    >>> [(row.rpm, round(row.lift_offs), round(row.level_db, 1)) for row in run.by_speed]
    [(300.0, 0, 83.7), (450.0, 1, 92.5)]
    """
    cam_set = resolve_cams(cams, rig)
    names, speeds = list(cam_set.cams), resolve_speeds(rpm)
    schedule = turns, transient_turns, sample_rate, ramp
    scene = scene_of("sweep", names, cam_set.rig, model, speeds, *schedule)
    loaded = LoadedScene(
        scene,
        cam_set.rig,
        cam_set.cams,
        cam_set.laws,
        scene_file=Path(f"{scene.name}.yaml"),
        rig_file=Path(f"{cam_set.rig.name}.yaml"),
        cam_files={name: Path(f"{name}.yaml") for name in cam_set.cams},
    )
    progress.start(tick_count(scene), "sweep")
    return run_scene(loaded, on_tick=progress.advance)
