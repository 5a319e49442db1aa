"""Bounce maps: what a follower does above its jump speed, turn after turn, over what is swept."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from pathlib import Path

from cam_rig.arguments import checked, on_one_axis
from cam_rig.dynamics.events.backend import expect_many
from cam_rig.dynamics.turn_map import ON_THE_CAM, State
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.simulation.asked import MAX_SPEEDS, Speeds, speeds_within
from cam_rig.studies.bounce.branches import Branch, branches
from cam_rig.studies.bounce.motion import ONE_MASS, SEEN, TWO_MASS, bouncing
from cam_rig.studies.bounce.result import ABOVE, BEGUN, REST, BounceMap, BounceRow
from cam_rig.studies.bounce.rows import BounceFiles, BounceRuns, kept_rows
from cam_rig.studies.bounce.sweep import RESTITUTION, SPEED, SWEPT, OperatingPoint, Sweep
from cam_rig.units import RPM

#: Rows that are sent to a process together.
TOGETHER = 4
#: Fewest turns that can be told to be periodic or not.
LEAST_TURNS = 5 * SEEN
#: Most turns of a row: some 40 s, 240 MB.
MOST_TURNS = 2_000_000


@checked
def bounce_map(
    law: Law,
    rig: RigConfig,
    *,
    rpm: Speeds,
    restitution: float | None = None,
    model: str = ONE_MASS,
    over: str = SPEED,
    values: Speeds | None = None,
    turns: int = 200,
    settle: int = 300,
    start: str = REST,
    follow: bool = False,
    out: str | Path | None = None,
    resume: bool = False,
    executor: Executor | None = None,
    workers: int = 1,
    progress: Progress = NULL_PROGRESS,
) -> BounceMap:
    """``cam-rig bounce``: what a follower does turn after turn: at rest, periodic or irregular.

    Impacts are roots and flights closed forms, so each turn's derivative is exact, and the Lyapunov
    exponent is no estimate from a time series. Where its error hides zero, it is "not told".

    Parameters
    ----------
    rpm : cam speeds; one where something else is swept
    restitution : of a landing, from 0 to below 1; None is the rig's
    model : ``one_mass``, rigid; or ``two_mass``, a roller and an end mass on an elastic stem
    over, values : at one speed what is swept, ``restitution``, ``preload`` (N) or ``mass`` (kg)
    turns, settle : kept in each row, and before these
    start : ``rest``: each row from the cam; ``below``, ``above``: where that row has ended
    follow : follow each periodic motion that does not rest over all rows, and where it changes
    out, resume : keep rows in a folder of Parquet files; go on with those that it has not
    executor, workers : where rows from the cam are computed, and how many batches at a time

    Raises
    ------
    ConfigError, DynamicsError : an argument out of range, a rig without a number, endless landings
    OutputError, MissingLibraryError : of a folder, or pyarrow for it

    Examples
    --------
    >>> import cam_rig
    >>> law, rig = cam_rig.build_law(cam_rig.load_cam("tm21")), cam_rig.load_rig("tm21")
    >>> found = cam_rig.bounce_map(law, rig, rpm=[420, 450], restitution=0.7, turns=40, settle=60)
    >>> [row.motion for row in found.rows]
    ['irregular', 'periodic']
    """
    sweep, swept = _sweep(rig, model, speeds_within(rpm), restitution, over, values)
    _check(len(swept), turns, settle, start, follow)
    _check_kept(out, resume, start)
    runs = BounceRuns.of(law, rig, sweep, swept, settle, turns)
    expect_many()
    if out is not None:
        found = kept_rows(BounceFiles(Path(out), runs), resume, executor, workers, progress)
    else:
        found = _found(runs, start, executor, progress)
    lines = _followed(runs, found, progress) if follow else ()
    return BounceMap(law, rig, sweep, start, sweep.lift_off(law, swept), tuple(found), lines)


def _found(
    runs: BounceRuns, start: str, executor: Executor | None, progress: Progress
) -> list[BounceRow]:
    """A row a value, from the cam or one from another."""
    progress.start(runs.total, runs.law.name)
    way, found = -1 if start == ABOVE else 1, []
    for row in _from_rest(runs, executor) if start == REST else _continued(runs, way):
        found.append(row)
        progress.advance()
    return found[::way]


def _sweep(
    rig: RigConfig,
    model: str,
    rpm: list[float],
    restitution: float | None,
    over: str,
    values: Speeds | None,
) -> tuple[Sweep, list[float]]:
    """What is swept, and its values, SI, that rise."""
    if model not in (ONE_MASS, TWO_MASS):
        raise ConfigError(f"model: is {model!r}; allowed: {ONE_MASS}, {TWO_MASS}")
    if over not in SWEPT:
        raise ConfigError(f"over: is {over!r}; allowed: {', '.join(SWEPT)}")
    if over == SPEED and values is not None:
        raise ConfigError(
            "--range: is given where the speed is swept; allowed: --over another number"
        )
    if over == SPEED:
        swept = sorted(one * RPM for one in rpm)
        return Sweep(OperatingPoint(bouncing(rig, restitution, model), swept[0])), swept
    if len(rpm) > 1:
        raise ConfigError(f"rpm: are {len(rpm)} speeds over {over}; allowed: one speed")
    swept = [] if values is None else sorted(map(float, on_one_axis("values", values)))
    if not 1 <= len(swept) <= MAX_SPEEDS:
        raise ConfigError(f"--range: are {len(swept)} of {over}; allowed: 1 to {MAX_SPEEDS}")
    if over == RESTITUTION:
        if restitution is not None:
            raise ConfigError("--restitution: is what is swept; allowed: --range alone")
        restitution = swept[0]
    sweep = Sweep(OperatingPoint(bouncing(rig, restitution, model), rpm[0] * RPM), over)
    for one in swept:  # one that is none is refused before any is turned
        sweep.at(one)
    return sweep, swept


def _followed(
    runs: BounceRuns, rows: Sequence[BounceRow], progress: Progress
) -> tuple[Branch, ...]:
    """The branches of the periodic motions of some rows, over all of them."""
    progress.describe("periodic motions")
    sweep = runs.sweep
    free = [row for row in rows if row.period is not None and not row.rests]
    seen = [(sweep.value(row.point), row.end, row.period or 1) for row in free]
    low, high = (sweep.value(rows[i].point) for i in (0, -1))
    return branches(runs.law, sweep, seen, low, high)


def _check(rows: int, turns: int, settle: int, start: str, follow: bool) -> None:
    """Refuse arguments out of range."""
    if start not in BEGUN:
        raise ConfigError(f"start: is {start!r}; allowed: {', '.join(BEGUN)}")
    if turns < LEAST_TURNS:
        raise ConfigError(f"turns: is {turns}; allowed: {LEAST_TURNS} or more")
    if settle < 0:
        raise ConfigError(f"settle: is {settle}; allowed: 0 or more turns")
    if follow and rows < 2:
        raise ConfigError("follow: over one value; allowed: two or more, as 385:480:5")
    if settle + turns > MOST_TURNS:
        raise ConfigError(
            f"turns: are {turns} after {settle} to settle; allowed: {MOST_TURNS} together"
        )


def _check_kept(out: str | Path | None, resume: bool, start: str) -> None:
    if resume and out is None:
        raise ConfigError("resume: without a folder; allowed: with out")
    if out is not None and start != REST:
        raise ConfigError(
            f"--out: keeps rows that begin on the cam, not {start}; allowed: --from {REST}"
        )


def _from_rest(runs: BounceRuns, executor: Executor | None) -> Iterator[BounceRow]:
    together = 1 if executor is None else TOGETHER
    parts = [runs.values[i : i + together] for i in range(0, runs.total, together)]
    for rows in (map if executor is None else executor.map)(runs.rows, parts):
        yield from rows


def _continued(runs: BounceRuns, way: int) -> Iterator[BounceRow]:
    begin: State = ON_THE_CAM
    for one in runs.values[::way]:
        row = runs.row(one, begin)
        begin = row.end
        yield row
