"""The work-precision plot: error against wall time, one panel per case."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.bench.result import CaseResult, WorkPrecisionStudy
from cam_rig.drawing.colours import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILION, web
from cam_rig.plots.figures import empty, logarithmic, styled, write

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


def draw(study: WorkPrecisionStudy, path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write(figure(study), path)


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
