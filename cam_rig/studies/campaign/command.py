"""Command ``cam-rig campaign``, which measures many rigs with varied numbers."""

from __future__ import annotations

import shlex
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.errors import DynamicsError, OutputError, RunError
from cam_rig.show.command import LOG_PERIOD_S, Dask, Jobs, command
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import console, say
from cam_rig.studies.campaign.campaign import batch_task

if TYPE_CHECKING:
    from cam_rig.studies.campaign.campaign import Campaign
    from cam_rig.studies.campaign.dataset import CampaignDataset
    from cam_rig.workers import ExecutorPool

    Place = Callable[[], AbstractContextManager[ExecutorPool]]

#: Units of a displayed time, longest first, each with its length in s.
UNITS = (("d", 86400.0), ("h", 3600.0), ("min", 60.0), ("s", 1.0))
#: Units of a displayed file size, largest first, each with its number of bytes.
SIZES = (("GB", 1e9), ("MB", 1e6), ("kB", 1e3))


class CampaignProgress(Progress):
    """Progress display of a campaign: points per second, remaining time and file size.

    It is a progress bar on a terminal, and otherwise a log line from time to time.
    """

    def __init__(self, dataset: CampaignDataset, bar: Progress) -> None:
        self._dataset, self._bar, self._name = dataset, bar, dataset.campaign.config.name
        self._total = dataset.campaign.total
        self._done = self._total - sum(last - first for first, last in dataset.missing())
        self._start: tuple[float, int] | None = None
        self._last_log, self._size = time.monotonic(), ""
        bar.start(self._total, self._name)
        bar.advance(self._done)

    def advance(self, steps: int = 1) -> None:
        """Count ``steps`` more measured points (rigs) and update the display."""
        self._done += steps
        self._bar.advance(steps)
        time_s = time.monotonic()
        if self._start is None:  # the rate does not include the start-up time of the workers
            self._start = time_s, self._done
        remaining, is_due = self._total - self._done, time_s - self._last_log >= LOG_PERIOD_S
        if is_due:
            self._last_log, self._size = time_s, format_size(*self._dataset.size())
        seconds, points, rate = time_s - self._start[0], self._done - self._start[1], ""
        if points and seconds > 0.0:
            rate = (
                f"{points / seconds:.3g} points/s, {format_time(remaining * seconds / points)} left"
            )
        status = ", ".join(filter(None, (rate, self._size)))
        self._bar.describe(f"{self._name} {status}")
        if is_due and remaining and not console.is_terminal:
            say(f"{self._name}: {self._done} of {self._total} points, {status}")


def format_time(seconds: float) -> str:
    """Return a time (s) as text, in the largest unit in which it is at least 2."""
    unit, length = next((entry for entry in UNITS if seconds >= 2.0 * entry[1]), UNITS[-1])
    return f"{seconds / length:.2g} {unit}" if length > 1.0 else f"{seconds:.0f} s"


def format_size(present: float, total: float) -> str:
    """Return the present size and the expected final size of files as text.

    Both arguments are in bytes.
    """
    unit, length = next((entry for entry in SIZES if total >= entry[1]), SIZES[-1])
    return f"{present / length:.3g} of about {total / length:.3g} {unit}"


@command("plot", "csv", "json")
def campaign(
    study: Annotated[str, typer.Argument(help="Study file, or a name in config/campaigns.")],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder of the dataset (default: out/NAME)."),
    ] = None,
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Compute only the points that the folder does not contain."),
    ] = False,
    points: Annotated[
        int | None, typer.Option(help="Number of points, replaces the study's.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed, replaces the study's.")] = None,
    jobs: Jobs = None,
    dask: Dask = None,
    *,
    progress: Progress,
) -> Result:
    """Measure thousands of rigs that differ in some numbers, one row per rig.

    The study defines the inputs that vary, the points, and the measures: jump speeds, vibration,
    forces, levels. Rows are stored in a folder of Parquet files, which is readable during the run.
    Tables of quantiles, yields and shares follow. Rows do not depend on the number of processes,
    also on a Dask cluster. Ctrl-C keeps finished points, and --resume continues.

    In Python: cam_rig.campaign(study, out, points, seed, resume, executor)

    Examples
    --------
    cam-rig campaign tolerance_poly345 --points 256 --plot out/tolerances.png

    cam-rig campaign jump_map --out out/map --resume
    """
    from cam_rig.schema.load import resolve_path
    from cam_rig.studies.campaign.campaign import open_campaign
    from cam_rig.workers import check_executor_options, executor_pool

    check_executor_options(jobs, dask)
    planned = open_campaign(resolve_path("campaigns", study)).with_plan(points, seed)
    pool = partial(executor_pool, jobs, dask)
    values = {"--points": points, "--seed": seed, "--jobs": jobs, "--dask": dask}
    options = [(key, str(value)) for key, value in values.items() if value is not None]
    folder = out or Path("out") / planned.config.name
    arguments = ["cam-rig", "campaign", study, "--out", str(folder), "--resume"]
    resume_command = shlex.join([*arguments, *chain.from_iterable(options)])
    return _run(folder, planned, resume, pool, resume_command, progress)


def _run(
    folder: Path,
    planned: Campaign,
    resume: bool,
    pool: Place,
    resume_command: str,
    progress: Progress,
) -> Result:
    """Compute the missing points and return the result of the campaign.

    ``pool`` creates the processes that measure the points. Errors and interrupts are reported with
    the command ``resume_command`` that continues the campaign.
    """
    from cam_rig.datasets.batches import compute_missing
    from cam_rig.extras import require
    from cam_rig.studies.campaign.dataset import CampaignDataset
    from cam_rig.studies.campaign.results import CampaignResult

    require("pyarrow")
    dataset = CampaignDataset(folder, planned)
    with dataset.open(resume) as damaged, _with_resume_command(resume_command):
        if damaged:
            say(damaged)
        if dataset.missing():
            with pool() as workplace:
                reporter = CampaignProgress(dataset, progress)
                compute_missing(dataset, batch_task, workplace.executor, workplace.count, reporter)
    result = CampaignResult(dataset)
    if result.failed == result.points:
        raise DynamicsError(
            f"{planned.config.name}: {result.failures}; the rows in {folder} contain all reasons; "
            "change the numbers of the study"
        )
    return result


@contextmanager
def _with_resume_command(resume_command: str) -> Iterator[None]:
    """Add the command that continues a campaign to the texts of errors and interrupts."""
    try:
        yield
    except KeyboardInterrupt as interrupt:
        interrupt.args = (
            f"{interrupt}; finished points are stored, continue with: {resume_command}",
        )
        raise
    except (OutputError, RunError) as error:
        raise type(error)(f"{error}; continue with: {resume_command}") from None
