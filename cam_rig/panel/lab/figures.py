"""Figure of a class: differences between answers and true values by student."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cam_rig.panel.lab.labs import LABS
from cam_rig.panel.lab.marking import MarksResult
from cam_rig.show.figure import empty, styled
from cam_rig.show.looks import BLUE, VERMILION, web

#: Largest number of letters of a student's name in the figure. A longer name is cut.
MAX_NAME_LENGTH = 26
#: Height of the row of a student in the figure, inches.
ROW_HEIGHT_IN = 0.26
#: Number of bars of the histogram.
BARS = 31
#: Grey level of the range within the tolerance of an answer.
TOLERANCE_SHADE = "0.92"


@styled
def marks_figure(result: MarksResult) -> Figure:
    """Return the figure of the marks of a class.

    The upper axes have one row per sheet, with full markers for answers beyond the tolerance. The
    lower axes have the histogram of all answers.
    """
    sheets = sorted(result.sheets, key=lambda sheet: sheet.max_error_percent)
    figure = empty(2.6 + ROW_HEIGHT_IN * len(sheets))
    above, below = figure.subplots(
        2, 1, sharex=True, height_ratios=(0.6 + ROW_HEIGHT_IN * len(sheets), 1.6)
    )
    for row, sheet in enumerate(sheets):
        width = 2.0 * sheet.tolerance
        above.barh(row, width, 1.0, -sheet.tolerance, color=TOLERANCE_SHADE, zorder=0)
        for mark in sheet.marks:
            colour = web(BLUE if mark.within else VERMILION)
            face = "none" if mark.within else colour
            above.plot(mark.difference_percent, row, "o", mfc=face, mec=colour, clip_on=False)
        if not sheet.marks:
            above.text(0.0, row, "no answer", ha="center", va="center")
    names = [sheet.recorded.student or sheet.path.stem for sheet in sheets]
    above.set_yticks(range(len(sheets)), [name[:MAX_NAME_LENGTH] for name in names])
    above.set_ylim(len(sheets) - 0.4, -0.6)
    errors = [mark.difference_percent for sheet in sheets for mark in sheet.marks]
    below.hist(errors, BARS, color=web(BLUE))
    questions = sorted({LABS[sheet.recorded.lab].question for sheet in sheets})
    below.set(xlabel=f"answer minus true {' or '.join(questions)} [%]", ylabel="answers")
    below.yaxis.set_major_locator(MaxNLocator(integer=True))
    if len({sheet.tolerance for sheet in sheets}) == 1:
        below.axvspan(-sheets[0].tolerance, sheets[0].tolerance, color=TOLERANCE_SHADE, zorder=0)
    return figure
