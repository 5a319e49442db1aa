"""Function ``bounce_map``: motion of a follower over values of a swept quantity.

The motion is observed once per turn of the cam.
"""

from __future__ import annotations

from concurrent.futures import Executor
from pathlib import Path

from cam_rig.arguments import check_arguments, to_vector
from cam_rig.dynamics.turn_map import ON_THE_CAM
from cam_rig.errors import ConfigError
from cam_rig.schema import RigConfig
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.simulation.inputs import (
    MAX_SPEEDS,
    LawOrCam,
    RequiredRig,
    Speeds,
    check_speeds,
    resolve_law,
    resolve_rig,
)
from cam_rig.studies.bounce.branches import Branch, branches
from cam_rig.studies.bounce.motion import MIN_REPEATS, ONE_MASS, TWO_MASS, bouncing
from cam_rig.studies.bounce.result import (
    START_ABOVE,
    START_ON_CAM,
    START_TEXT,
    BounceMap,
    BounceRow,
)
from cam_rig.studies.bounce.rows import BounceFiles, BounceRuns, stored_rows
from cam_rig.studies.bounce.sweep import RESTITUTION, SPEED, SWEPT, OperatingPoint, Sweep
from cam_rig.units import RPM

#: Number of rows (runs at one swept value) that are sent to a process together.
BATCH_ROWS = 4
#: Smallest number of kept turns from which a motion can be classified.
MIN_TURNS = 5 * MIN_REPEATS
#: Largest number of turns per run. A run of this length takes about 40 s and 240 MB.
MAX_TURNS = 2_000_000


@check_arguments
def bounce_map(
    law: LawOrCam,
    rig: RequiredRig,
    *,
    rpm: Speeds,
    restitution: float | None = None,
    model: str = ONE_MASS,
    parameter: str = SPEED,
    values: Speeds | None = None,
    turns: int = 200,
    transient_turns: int = 300,
    start: str = START_ON_CAM,
    continuation: bool = False,
    out: str | Path | None = None,
    resume: bool = False,
    executor: Executor | None = None,
    workers: int = 1,
    progress: Progress = NULL_PROGRESS,
) -> BounceMap:
    """Compute the motion of a follower per turn: in contact, periodic or irregular.

    The command is ``cam-rig bounce``. Landings are exact roots and flights have a closed form. The
    derivative of each turn is therefore exact, and the Lyapunov exponent is not estimated from a
    time series. A motion that does not repeat, and whose exponent is not positive by more than its
    error, is "undetermined".

    Parameters
    ----------
    law : Law, Cam, str or Path
        Motion law, or a cam: its name in ``config/cams``, its path, or the object.
    rig : Rig, str or Path
        Rig: its name in ``config/rigs``, its path, or the object.
    rpm : float or sequence of float
        Cam speeds, rpm. A single speed is needed if another quantity is swept.
    restitution : float, optional
        Coefficient of restitution of a landing, 0 to below 1 (default: the rig's value).
    model : str, optional
        ``one_mass`` (rigid, default), or ``two_mass`` with a roller and an end mass on an elastic
        stem.
    parameter : str, optional
        Swept quantity: ``rpm`` (default), ``restitution``, ``preload`` or ``mass``.
    values : sequence of float, optional
        Values of a swept quantity other than ``rpm``: preload in N, mass in kg.
    turns : int, optional
        Number of kept turns of each run, at least 20 (default: 200). The motion is classified from
        them.
    transient_turns : int, optional
        Number of turns before the kept turns (default: 300).
    start : str, optional
        Initial state of each run. ``rest`` (default): at rest on the cam. ``below`` or ``above``:
        the end state of the run at the next lower or higher swept value.
    continuation : bool, optional
        Follow each periodic motion that does not rest on the cam over all swept values, and find
        its bifurcations (default: False).
    out : str or Path, optional
        Folder of Parquet files in which rows are stored (default: not stored).
    resume : bool, optional
        Compute only the rows that the folder does not contain (default: False).
    executor : Executor, optional
        Executor that computes the rows if each run starts at rest (default: this process).
    workers : int, optional
        Number of batches that the executor processes at a time (default: 1).
    progress : Progress, optional
        Receiver of the progress.

    Returns
    -------
    BounceMap
        Motion of the follower, one row per swept value.

    Raises
    ------
    ConfigError
        If an argument is out of range, a number is missing in the rig, or the folder has rows of
        another bounce map, or any rows without ``resume``.
    DynamicsError
        If a swept value is invalid, or a turn has too many landings.
    OutputError
        If the folder cannot be written.
    MissingLibraryError
        If ``out`` is given and pyarrow is not installed.

    Examples
    --------
    >>> import cam_rig
    >>> turns = {"turns": 40, "transient_turns": 60}
    >>> result = cam_rig.bounce_map("tm21", "tm21", rpm=[420, 450], restitution=0.7, **turns)
    >>> [row.motion for row in result.rows]
    ['irregular', 'periodic']
    """
    law, rig = resolve_law(law), resolve_rig(rig, law)
    sweep, swept = _sweep(rig, model, check_speeds(rpm), restitution, parameter, values)
    _check(len(swept), turns, transient_turns, start, continuation)
    if resume and out is None:
        raise ConfigError("resume requires a folder; add out")
    if out is not None and start != START_ON_CAM:
        raise ConfigError(
            f"--out cannot be combined with --from {start}; use --from {START_ON_CAM}"
        )
    runs = BounceRuns.of(law, rig, sweep, swept, transient_turns, turns)
    if out is not None:
        rows = stored_rows(BounceFiles(Path(out), runs), resume, executor, workers, progress)
    else:
        rows = _compute_rows(runs, start, executor, progress)
    followed: tuple[Branch, ...] = ()
    if continuation:
        progress.describe("periodic motions")
        flying = [row for row in rows if row.period is not None and not row.comes_to_rest]
        motions = [(sweep.value(row.point), row.end, row.period or 1) for row in flying]
        low, high = (sweep.value(rows[i].point) for i in (0, -1))
        followed = branches(law, sweep, motions, low, high)
    return BounceMap(law, rig, sweep, start, sweep.lift_off(law, swept), tuple(rows), followed)


def _compute_rows(
    runs: BounceRuns, start: str, executor: Executor | None, progress: Progress
) -> list[BounceRow]:
    """Compute one row per swept value, in rising order.

    ``start`` selects the initial state of each run: at rest on the cam, or the end state of the run
    at the neighbouring value. Only runs from rest use the executor.
    """
    progress.start(runs.total, runs.law.name)
    rows = list[BounceRow]()
    if start == START_ON_CAM:
        size = 1 if executor is None else BATCH_ROWS
        batches = [runs.values[i : i + size] for i in range(0, runs.total, size)]
        for batch in (map if executor is None else executor.map)(runs.rows, batches):
            for row in batch:
                rows.append(row)
                progress.advance()
        return rows
    step = -1 if start == START_ABOVE else 1
    for value in runs.values[::step]:
        rows.append(runs.row(value, rows[-1].end if rows else ON_THE_CAM))
        progress.advance()
    return rows[::step]


def _sweep(
    rig: RigConfig,
    model: str,
    rpm: list[float],
    restitution: float | None,
    parameter: str,
    values: Speeds | None,
) -> tuple[Sweep, list[float]]:
    """Return the swept quantity, and its values in SI in rising order.

    The arguments are those of `bounce_map`. Invalid values raise an error before any row is
    computed.
    """
    if model not in (ONE_MASS, TWO_MASS):
        raise ConfigError(f"model must be {ONE_MASS} or {TWO_MASS}, got {model!r}")
    if parameter not in SWEPT:
        raise ConfigError(f"parameter must be one of {', '.join(SWEPT)}, got {parameter!r}")
    if parameter == SPEED and values is not None:
        raise ConfigError("values requires a swept parameter other than rpm; add --parameter")
    if parameter == SPEED:
        swept = sorted(speed * RPM for speed in rpm)
        return Sweep(OperatingPoint(bouncing(rig, restitution, model), swept[0])), swept
    if len(rpm) > 1:
        raise ConfigError(f"rpm must be one speed if {parameter} is swept, got {len(rpm)}")
    swept = [] if values is None else sorted(map(float, to_vector("values", values)))
    if not 1 <= len(swept) <= MAX_SPEEDS:
        raise ConfigError(
            f"values must be 1 to {MAX_SPEEDS} values of {parameter}, got {len(swept)}"
        )
    if parameter == RESTITUTION:
        if restitution is not None:
            raise ConfigError("restitution cannot be combined with a swept restitution")
        restitution = swept[0]
    sweep = Sweep(OperatingPoint(bouncing(rig, restitution, model), rpm[0] * RPM), parameter)
    for value in swept:  # raises an error for an invalid value
        sweep.at(value)
    return sweep, swept


def _check(rows: int, turns: int, transient_turns: int, start: str, continuation: bool) -> None:
    """Raise a `ConfigError` if an argument of a bounce map is out of range."""
    if start not in START_TEXT:
        raise ConfigError(f"start must be one of {', '.join(START_TEXT)}, got {start!r}")
    if turns < MIN_TURNS:
        raise ConfigError(f"turns must be {MIN_TURNS} or more, got {turns}")
    if transient_turns < 0:
        raise ConfigError(f"transient_turns must be 0 or more, got {transient_turns}")
    if continuation and rows < 2:
        raise ConfigError("continuation requires two or more values, such as 385:480:5")
    if transient_turns + turns > MAX_TURNS:
        raise ConfigError(
            f"turns and transient_turns must be at most {MAX_TURNS} together, got "
            f"{turns + transient_turns}"
        )
