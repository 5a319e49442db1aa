"""Result of the comparison: error against time, campaign, samples per second."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar

import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmark.speed.campaign import CAMPAIGN, campaign_records
from benchmark.speed.cases import QUICK_TURNS
from benchmark.speed.study import CaseResult, WorkPrecisionPoint, WorkPrecisionStudy
from cam_rig.show.command import command
from cam_rig.show.figure import empty, logarithmic, styled
from cam_rig.show.looks import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY_BLUE, VERMILION, web
from cam_rig.show.result import NULL_PROGRESS, Column, Progress, Records, Result


@dataclass(frozen=True)
class MeasuredPoint:
    """Error and time of a solver at a setting in a case.

    cam_rig has no tolerance and no ratio. ``compared`` is True for the setting in the table.
    ``only_a_bound`` is True if the peer never reached the accuracy of cam_rig.
    """

    case: str
    solver: str
    point: WorkPrecisionPoint | None
    ratio: float | None = None
    only_a_bound: bool = False
    compared: bool = True
    note: str = ""

    @property
    def words(self) -> str:
        """Solver and tolerance, or the reason for a missing point."""
        if self.point is None:
            return f"{self.solver}: {self.note}"
        return self.solver if self.point.rtol is None else f"{self.solver} {self.point.rtol:.0e}"

    @property
    def bound(self) -> str | None:
        """Time relative to cam_rig, marked with ">" if it is only a bound."""
        if self.ratio is None:
            return None
        return f"{'> ' * self.only_a_bound}{self.ratio:.{0 if self.ratio >= 10 else 1}f}"


POINT_COLUMNS = (
    Column("case", cell=lambda point: point.case if point.solver == RIG_NAME else ""),
    Column("solver", cell=lambda point: point.words, heading="solver, rtol"),
    Column("rtol", "1", of="point.rtol", hidden=True),
    Column("time", "ms", ".2g", of="point.time_s"),
    Column("error", "", ".1e", of="point.error"),
    Column("event_error", "s", ".1e", of="point.event_error_s", heading="events"),
    Column("ratio", "1", heading="x rig", cell=lambda point: point.bound),
    Column("repeats", of="point.repeats", hidden=True),
    Column("only_a_bound", doc="it never was as good as the rig", hidden=True),
    Column("compared", doc="the setting that people read", hidden=True),
    Column("note", hidden=True),
)

SAMPLES = (Column("model", of="0"), Column("samples_per_s", "1/s", of="1"))

CONDITIONS = (Column("quick"), Column("cores"), Column("took", "s", of="took_s"))

#: Notes for the readers of the table.
KEY = (
    "Each peer at its fastest setting with an error no larger than the rig's. If no setting "
    "reaches this error, the fastest setting within ten times the smallest error of the peer is "
    "used, and the ratio, marked >, is a bound."
)

RIG_NAME = "rig"


class Comparison(Result):
    """Comparison with all points, a campaign and its peer, and samples per second."""

    schema = "cam_rig.speed.1"
    plot_function = "benchmark.speed.report:figure"
    columns: ClassVar = {
        "points": POINT_COLUMNS,
        "campaign": CAMPAIGN,
        "samples": SAMPLES,
        "run": CONDITIONS,
    }

    def __init__(self, study: WorkPrecisionStudy) -> None:
        self.study = study

    def tables(self) -> list[Records]:
        """Return all tables. Samples per second and conditions are not displayed."""
        study = self.study
        rate = min(study.rates.values()) / 1e6
        caption = (
            f"One of {study.cores} cores, {study.took_s:.0f} s; "
            f"{rate:.0f} million samples of six numbers per second"
        )
        return [
            self.table(
                "points", caption, measured(study), KEY, row_filter=lambda point: point.compared
            ),
            campaign_records(study.campaign),
            self.table("samples", "", study.rates.items(), hidden=True),
            self.table("run", "", [study], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Return notes on settings that were left out or shortened."""
        return notes(self.study)


def measured(study: WorkPrecisionStudy) -> Iterator[MeasuredPoint]:
    """Yield the points by case: cam_rig, then the settings of each peer."""
    for name, result in study.cases.items():
        yield MeasuredPoint(name, RIG_NAME, result.rig, note=result.missing or "")
        for peer in result.peers:
            sweeps = [sweep for sweep in result.sweeps if sweep.peer.name == peer]
            best = result.best(peer)
            if best is None:
                notes_of_peer = [note for sweep in sweeps for note in sweep.notes]
                yield MeasuredPoint(name, peer, None, note=(notes_of_peer or ["not measured"])[0])
                continue
            pairs = [best, *((s, p) for s in sweeps for p in s.points if p is not best[1])]
            for sweep, point in pairs:
                bound = not result.as_good(point)
                yield MeasuredPoint(
                    name, sweep.peer.title, point, result.ratio(point), bound, point is best[1]
                )


def notes(study: WorkPrecisionStudy) -> list[str]:
    """Return a line for each setting that was left out or shortened."""
    out = [
        f"{name}: {sweep.peer.title}: {note}"
        for name, result in study.cases.items()
        for sweep in result.sweeps
        for note in sweep.notes
    ]
    if study.quick:
        out += [
            f"{name}: {r.case.turns} turns only, for the rig and the peers (quick)"
            for name, r in study.cases.items()
            if name in QUICK_TURNS
        ]
    return out


# -- figure of error against wall time, with a panel per case

#: Colours and markers that differ in print and for colour-blind readers.
STYLES = {
    "DOP853": (web(BLUE), "o"),
    "CVODE Adams": (web(ORANGE), "v"),
    "CVODE BDF": (web(VERMILION), "s"),
    "LSODA": (web(GREEN), "^"),
    "Radau": (web(PURPLE), "D"),
    "DOP853 numba": (web(SKY_BLUE), "P"),
}

RIG = (web(BLACK), "*")

#: Smallest plotted error, because an error can be zero.
MIN_ERROR = 1e-17


@styled
def figure(comparison: Comparison) -> Figure:
    """Draw error against wall time of cam_rig and all peers, with a panel per case."""
    study = comparison.study
    count = max(1, len(study.cases))
    columns = min(3, count)
    lines = -(-count // columns)
    out = empty(2.5 * lines + 0.6)
    panels = out.subplots(lines, columns, squeeze=False)
    for axes in panels.flat[count:]:
        axes.set_visible(False)
    for axes, result in zip(panels.flat, study.cases.values(), strict=False):
        _panel(axes, result)
    handles, labels = panels.flat[0].get_legend_handles_labels()
    out.legend(handles, labels, loc="outside lower center", ncols=3)
    return out


def _panel(axes: Axes, result: CaseResult) -> None:
    for sweep in result.sweeps:
        colour, marker = STYLES[sweep.peer.title]
        errors = [max(p.error, MIN_ERROR) for p in sweep.points]
        times = [p.time_s for p in sweep.points]
        label = sweep.peer.title
        axes.loglog(times, errors, color=colour, marker=marker, ms=4.5, label=label)
    if result.rig is not None:
        colour, marker = RIG
        error = max(result.rig.error, MIN_ERROR)
        axes.loglog([result.rig.time_s], [error], marker, color=colour, ms=13, label="this rig")
    axes.set_title(result.case.name)
    axes.set(xlabel="wall time [s]", ylabel="error / largest value [-]")
    logarithmic(axes.xaxis, axes.yaxis)


# -- command python -m benchmark.speed: error and time on this machine


@command("json", "csv", "plot")
def bench(
    quick: Annotated[bool, typer.Option("--quick", help="Fewer settings, about a minute.")] = False,
    *,
    progress: Progress,
) -> Comparison:
    """Measure error against time for the rig, scipy's solvers and SUNDIALS CVODE.

    The study uses one core. Set OMP_NUM_THREADS=1 for the same in numpy. It then measures a
    campaign's points per second against the same study with joblib and CVODE, on all cores. CVODE
    and joblib need the extra 'bench'.

    Examples
    --------
    python -m benchmark.speed --quick

    python -m benchmark.speed --json out/bench.json --plot out/bench.png
    """
    return measure(quick, progress)


def measure(quick: bool, progress: Progress = NULL_PROGRESS) -> Comparison:
    """Run the comparison. The campaign uses all cores."""
    import os

    from benchmark.speed.peers import PEERS
    from benchmark.speed.study import ORDER, run

    progress.start(len(ORDER) * len(PEERS) + 1, "bench")

    def advance(what: str) -> None:
        progress.describe(what)
        progress.advance()

    return Comparison(run(quick, advance, cores=os.cpu_count() or 1))
