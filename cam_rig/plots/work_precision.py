"""The work-precision plot: error against wall time, one panel a case."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from cam_rig.bench.result import CaseResult, WorkPrecisionStudy

#: Okabe-Ito colours and distinct markers: readable in print and by the colour-blind.
STYLES = {
    "DOP853": ("#0072B2", "o"),
    "CVODE Adams": ("#E69F00", "v"),
    "CVODE BDF": ("#D55E00", "s"),
    "LSODA": ("#009E73", "^"),
    "Radau": ("#CC79A7", "D"),
}
RIG = ("#000000", "*")
#: Errors below this are drawn here: rounding may be zero.
MIN_ERROR = 1e-17


def draw(study: WorkPrecisionStudy, path: Path) -> None:
    """Write the plot as PNG (or any format matplotlib knows by the suffix)."""
    count = max(1, len(study.cases))
    columns = min(3, count)
    lines = -(-count // columns)
    size = (4.0 * columns, 3.4 * lines + 0.6)
    figure, panels = plt.subplots(lines, columns, figsize=size, squeeze=False, layout="constrained")
    for axes in panels.flat[count:]:
        axes.set_visible(False)
    for axes, result in zip(panels.flat, study.cases.values(), strict=False):
        _panel(axes, result)
    handles, labels = panels.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6, fontsize=9)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _panel(axes: Axes, result: CaseResult) -> None:
    for sweep in result.sweeps:
        colour, marker = STYLES[sweep.peer.title]
        errors = [max(p.error, MIN_ERROR) for p in sweep.points]
        times = [p.time_s for p in sweep.points]
        label = sweep.peer.title
        axes.loglog(times, errors, color=colour, marker=marker, ms=4.5, lw=1.2, label=label)
    if result.rig is not None:
        colour, marker = RIG
        error = max(result.rig.error, MIN_ERROR)
        axes.loglog([result.rig.time_s], [error], marker, color=colour, ms=13, label="this rig")
    axes.set_title(result.case.name, fontsize=10)
    axes.set(xlabel="wall time [s]", ylabel="error / largest value")
    axes.grid(alpha=0.3)
