"""How far a campaign is, how long the rest takes and how large it gets: a bar, or lines."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Self

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from cam_rig.cli.common.console import console, say
from cam_rig.cli.common.screen import LINE_EVERY_S
from cam_rig.studies.campaign.dataset import CampaignDataset

#: Longest unit of a time in words that is still told in the one below, with its seconds.
UNITS = (("d", 86400.0), ("h", 3600.0), ("min", 60.0), ("s", 1.0))
SIZES = (("GB", 1e9), ("MB", 1e6), ("kB", 1e3))


class CampaignProgress:
    """Told of points as they are written; in a terminal a bar, elsewhere a line now and then.

    Time left and size are extrapolated from the points of this run, from its first batch on.
    """

    def __init__(self, dataset: CampaignDataset) -> None:
        self._dataset, self._total = dataset, dataset.campaign.total
        self._done = self._total - sum(last - first for first, last in dataset.missing())
        self._begin: tuple[float, int] | None = None
        self._told, self._size = time.monotonic(), ""
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(12),
            MofNCompleteColumn(),
            TextColumn("{task.fields[ahead]}"),
            console=console,
            transient=True,
        )
        name = dataset.campaign.config.name
        self._task = self._bar.add_task(name, total=self._total, completed=self._done, ahead="")

    def __enter__(self) -> Self:
        """Show the bar where there is a terminal."""
        if console.is_terminal:
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take the bar away."""
        if console.is_terminal:
            self._bar.stop()

    def advance(self, points: int) -> None:
        """So many more were written."""
        self._done += points
        now = time.monotonic()
        if self._begin is None:  # before it the workers started: no measure of what follows
            self._begin = now, self._done
        left, due = self._total - self._done, now - self._told >= LINE_EVERY_S
        if due:
            self._told, self._size = now, sized(*self._dataset.size())
        ahead = estimate(now - self._begin[0], self._done - self._begin[1], left) + self._size
        if console.is_terminal:
            self._bar.update(self._task, completed=self._done, ahead=ahead)
        elif due and left:
            name = self._dataset.campaign.config.name
            say(f"{name}: {self._done} of {self._total} points, {ahead}")


def estimate(seconds: float, points: int, left: int) -> str:
    """The rate of points made in so many s, and what time the others take."""
    if points == 0 or seconds <= 0.0:
        return ""
    rate = points / seconds
    return f"{rate:.3g} points/s, {in_words(left / rate)} left"


def in_words(seconds: float) -> str:
    """A time in the largest unit of which there are two or more."""
    unit, length = next((one for one in UNITS if seconds >= 2.0 * one[1]), UNITS[-1])
    return f"{seconds / length:.2g} {unit}" if length > 1.0 else f"{seconds:.0f} s"


def sized(now: float, in_all: float) -> str:
    """Bytes on the disk and at the end."""
    unit, length = next((one for one in SIZES if in_all >= one[1]), SIZES[-1])
    return f", {now / length:.3g} of about {in_all / length:.3g} {unit}"
