"""The study as plain data and as rows for a table."""

from __future__ import annotations

import math
from typing import Annotated, Any

import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmark.speed.cases import QUICK_TURNS
from benchmark.speed.study import CaseResult, Sweep, WorkPrecisionPoint, WorkPrecisionStudy
from cam_rig.show.command import (
    Csv,
    Json,
    Plot,
    check_outputs,
    progress_bar,
    user_errors,
    write_csv,
    write_json,
    write_plot,
)
from cam_rig.show.figure import empty, logarithmic, styled
from cam_rig.show.looks import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILION, web
from cam_rig.show.tables import DataTable, Head
from cam_rig.show.terminal import say, show

#: Headings; the first two are texts.
HEADER = ("case", "solver, rtol", "time", "error", "events", "x rig")

#: What a reader of the table must know.
KEY = (
    "Each peer at its cheapest setting with an error no larger than the rig's; where it has none, "
    "at its most accurate one: the ratio, marked >, is then a bound, for the same error costs more."
)


def to_json(study: WorkPrecisionStudy) -> dict[str, Any]:
    """The promised keys, and beside them what a reader needs to judge them."""
    return {
        "cases": {name: _case(result) for name, result in study.cases.items()},
        "samples_per_s": min(study.rates.values()),
        "samples_per_s_by_model": study.rates,
        "campaign": vars(study.campaign) | {"ratio": study.campaign.ratio},
        "quick": study.quick,
        "cores_used": 1,
        "cores": study.cores,
        "took_s": study.took_s,
    }


def _case(result: CaseResult) -> dict[str, Any]:
    rig: dict[str, Any] = {"time_s": None, "error": None, "note": result.missing}
    if result.rig is not None:
        rig = _point(result.rig)
    peers = {}
    for name in result.peers:
        best = result.best(name)
        if best is not None:
            sweep, point = best
            peers[name] = {
                **_point(point),
                "method": sweep.peer.method,
                "ratio": result.ratio(point),
                "no_worse_than_rig": result.as_good(point),
                "options": sweep.peer.options,
            }
    sweeps = {
        sweep.peer.title: {"settings": [_point(p) for p in sweep.points], "notes": sweep.notes}
        for sweep in result.sweeps
    }
    return {"title": result.case.title, "rig": rig, "peers": peers, "sweeps": sweeps}


def _point(point: WorkPrecisionPoint) -> dict[str, Any]:
    data = {"time_s": point.time_s, "error": point.error, "repeats": point.repeats}
    extra = {"event_error_s": point.event_error_s, "rtol": point.rtol}
    return data | {key: value for key, value in extra.items() if value is not None}


def table(study: WorkPrecisionStudy) -> DataTable:
    """The measured points: the rig, then each peer at the setting it is compared at."""
    rate = min(study.rates.values()) / 1e6
    return DataTable(
        f"One of {study.cores} cores, {study.took_s:.0f} s; "
        f"{rate:.0f} million samples of six numbers per second",
        tuple(Head(name, shown="" if i < 2 else "g") for i, name in enumerate(HEADER)),
        tuple(_rows(study)),
        (KEY,),
    )


def _rows(study: WorkPrecisionStudy) -> list[tuple[str, ...]]:
    out: list[tuple[str, ...]] = []
    for name, result in study.cases.items():
        if result.rig is None:
            out.append((name, f"rig: {result.missing}", "", "", "", ""))
        else:
            out.append((name, "rig", *_cells(result.rig), "1"))
        for peer in result.peers:
            best = result.best(peer)
            out.append(("", *(_peer(result, *best) if best else _absent(result, peer))))
    return out


def _cells(point: WorkPrecisionPoint) -> tuple[str, str, str]:
    events = "" if point.event_error_s is None else f"{point.event_error_s:.1e} s"
    digits = max(0, 1 - math.floor(math.log10(1e3 * point.time_s)))
    return f"{1e3 * point.time_s:.{digits}f} ms", f"{point.error:.1e}", events


def _peer(result: CaseResult, sweep: Sweep, point: WorkPrecisionPoint) -> tuple[str, ...]:
    ratio = result.ratio(point)
    bound = "" if result.as_good(point) else "> "
    title = f"{sweep.peer.title} {point.rtol:.0e}"
    shown = "" if ratio is None else f"{bound}{ratio:.{0 if ratio >= 10 else 1}f}"
    return title, *_cells(point), shown


def _absent(result: CaseResult, peer: str) -> tuple[str, ...]:
    notes = [n for s in result.sweeps if s.peer.name == peer for n in s.notes]
    return (f"{peer}: {notes[0] if notes else 'not measured'}", "", "", "", "")


def notes(study: WorkPrecisionStudy) -> list[str]:
    """What was left out or cut short, one line each."""
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


# The work-precision plot: error against wall time, one panel per case.

#: Colours and distinct markers: readable in print and by the colour-blind.
STYLES = {
    "DOP853": (web(BLUE), "o"),
    "CVODE Adams": (web(ORANGE), "v"),
    "CVODE BDF": (web(VERMILION), "s"),
    "LSODA": (web(GREEN), "^"),
    "Radau": (web(PURPLE), "D"),
}

RIG = (web(BLACK), "*")

#: Errors below this are drawn here: rounding may be zero.
MIN_ERROR = 1e-17


@styled
def figure(study: WorkPrecisionStudy) -> Figure:
    """Error against wall time of every solver and of the rig, one panel per case."""
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


# python -m benchmark.speed: the rig's speed and error on this machine, beside other solvers.


def bench(
    quick: Annotated[bool, typer.Option("--quick", help="Fewer settings, about a minute.")] = False,
    json_target: Json = None,
    csv: Csv = None,
    plot: Plot = None,
) -> None:
    """Measure error against time for the rig, scipy's solvers and SUNDIALS CVODE.

    One core; set OMP_NUM_THREADS=1 for the same in numpy. Then a campaign's points a second beside
    the same study with joblib and solve_ivp, on all cores. CVODE and joblib need the extra 'bench'.

    Examples
    --------
    python -m benchmark.speed --quick

    python -m benchmark.speed --json out/bench.json --plot out/bench.png
    """
    with user_errors():
        from benchmark.speed.campaign import campaign_table

        check_outputs(json_target, plot, csv)
        study = measure(quick)
        shown = [table(study), campaign_table(study.campaign)]
        show(*shown)
        say(*notes(study))
        write_csv(shown, csv)
        if plot is not None:
            write_plot(plot, lambda: figure(study))
        write_json(to_json(study), json_target)


def measure(quick: bool) -> WorkPrecisionStudy:
    """Run the study behind a progress bar."""
    import os

    from benchmark.speed.peers import PEERS
    from benchmark.speed.study import ORDER, run

    with progress_bar() as bar:
        task = bar.add_task("bench", total=len(ORDER) * len(PEERS) + 1)

        def advance(what: str) -> None:
            bar.update(task, description=what, advance=1)

        return run(quick, advance, cores=os.cpu_count() or 1)
