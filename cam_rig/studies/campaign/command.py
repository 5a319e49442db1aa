"""cam-rig campaign: thousands of rigs that differ in some numbers, on this machine or a cluster."""

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
from cam_rig.studies.campaign.campaign import measure_batch

if TYPE_CHECKING:
    from cam_rig.studies.campaign.campaign import Campaign
    from cam_rig.studies.campaign.dataset import CampaignDataset
    from cam_rig.workers import Workplace

    Place = Callable[[], AbstractContextManager[Workplace]]

#: Longest unit of a time in words that is still told in the one below, with its seconds.
UNITS = (("d", 86400.0), ("h", 3600.0), ("min", 60.0), ("s", 1.0))
SIZES = (("GB", 1e9), ("MB", 1e6), ("kB", 1e3))


class CampaignProgress(Progress):
    """A bar, elsewhere a line now and then: time left and size, by the points of this run."""

    def __init__(self, dataset: CampaignDataset, bar: Progress) -> None:
        self._dataset, self._bar, self._name = dataset, bar, dataset.campaign.config.name
        self._total = dataset.campaign.total
        self._done = self._total - sum(last - first for first, last in dataset.missing())
        self._begin: tuple[float, int] | None = None
        self._told, self._size = time.monotonic(), ""
        bar.start(self._total, self._name)
        bar.advance(self._done)

    def advance(self, steps: int = 1) -> None:
        """So many more were written."""
        self._done += steps
        self._bar.advance(steps)
        now = time.monotonic()
        if self._begin is None:  # before it the workers started: no measure of what follows
            self._begin = now, self._done
        left, due = self._total - self._done, now - self._told >= LOG_PERIOD_S
        if due:
            self._told, self._size = now, sized(*self._dataset.size())
        seconds, points, rate = now - self._begin[0], self._done - self._begin[1], ""
        if points and seconds > 0.0:
            rate = f"{points / seconds:.3g} points/s, {in_words(left * seconds / points)} left"
        ahead = ", ".join(filter(None, (rate, self._size)))
        self._bar.describe(f"{self._name} {ahead}")
        if due and left and not console.is_terminal:
            say(f"{self._name}: {self._done} of {self._total} points, {ahead}")


def in_words(seconds: float) -> str:
    """A time in the largest unit of which there are two or more."""
    unit, length = next((one for one in UNITS if seconds >= 2.0 * one[1]), UNITS[-1])
    return f"{seconds / length:.2g} {unit}" if length > 1.0 else f"{seconds:.0f} s"


def sized(now: float, in_all: float) -> str:
    """Bytes on the disk and at the end."""
    unit, length = next((one for one in SIZES if in_all >= one[1]), SIZES[-1])
    return f"{now / length:.3g} of about {in_all / length:.3g} {unit}"


@command("plot", "csv", "json")
def campaign(
    study: Annotated[str, typer.Argument(help="Study file, or a name in config/campaigns.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Of the dataset; by default out/NAME.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the points that the folder has not.")
    ] = False,
    points: Annotated[int | None, typer.Option(help="Points, in place of the study's.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed, in place of the study's.")] = None,
    jobs: Jobs = None,
    dask: Dask = None,
    *,
    progress: Progress,
) -> Result:
    """Measure thousands of rigs that differ in some numbers, and keep a row of each.

    The study says what varies, at which points, and what is measured: jump speeds, vibration,
    forces, levels. Rows go into a folder of Parquet files, readable while it runs; tables of
    quantiles, yields and shares follow. Rows are the same on any number of processes, and on a
    Dask cluster. Ctrl-C keeps what is finished; --resume goes on.

    In Python: cam_rig.campaign(study, out, points, seed, resume, executor)

    Examples
    --------
    cam-rig campaign tolerance_poly345 --points 256 --plot out/tolerances.png

    cam-rig campaign jump_map --out out/map --resume
    """
    from cam_rig.schema.load import named_path
    from cam_rig.studies.campaign.campaign import open_campaign
    from cam_rig.workers import check_workplace, workplace

    check_workplace(jobs, dask)
    asked = open_campaign(named_path("campaigns", study)).planned(points, seed)
    there = partial(workplace, jobs, dask)
    given = {"--points": points, "--seed": seed, "--jobs": jobs, "--dask": dask}
    options = [(key, str(value)) for key, value in given.items() if value is not None]
    folder = out or Path("out") / asked.config.name
    words = ["cam-rig", "campaign", study, "--out", str(folder), "--resume"]
    again = shlex.join([*words, *chain.from_iterable(options)])
    return _measured(folder, asked, resume, there, again, progress)


def _measured(
    folder: Path, asked: Campaign, resume: bool, there: Place, again: str, progress: Progress
) -> Result:
    """Make the points that are missing; what ends it says how to go on."""
    from cam_rig.datasets.batches import compute_missing
    from cam_rig.extras import require
    from cam_rig.studies.campaign.dataset import CampaignDataset
    from cam_rig.studies.campaign.results import CampaignResult

    require("pyarrow")
    dataset = CampaignDataset(folder, asked)
    with dataset.opened(resume) as damaged, _going_on(again):
        if damaged:
            say(damaged)
        if dataset.missing():
            with there() as place:
                told = CampaignProgress(dataset, progress)
                compute_missing(dataset, measure_batch, place.executor, place.count, told)
    found = CampaignResult(dataset)
    if found.failed == found.points:
        raise DynamicsError(
            f"{asked.config.name}: {found.failures}; the rows in {folder} have the reason of each; "
            "remedy: other numbers in the study's vary"
        )
    return found


@contextmanager
def _going_on(again: str) -> Iterator[None]:
    """Ends of a run that leave something to go on with: the command that does is named."""
    try:
        yield
    except KeyboardInterrupt as interrupt:
        interrupt.args = (f"{interrupt}; what is finished stays, go on with: {again}",)
        raise
    except (OutputError, RunError) as error:
        raise type(error)(f"{error}; go on with: {again}") from None
