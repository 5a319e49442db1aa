"""A class's lab sheets at a glance: how far each student's answers are from the truth."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cam_rig.panel.lab.labs import LABS
from cam_rig.panel.lab.marking import MarksResult
from cam_rig.show.figure import empty, styled
from cam_rig.show.looks import BLUE, VERMILION, web

#: A name is cut after so many letters; inches a student; bars of the histogram; shade of what is
#: within the tolerance.
LETTERS, ROW, BARS, SHADE = 26, 0.26, 31, "0.92"


@styled
def marks_figure(found: MarksResult) -> Figure:
    """Answers a row a sheet, full markers beyond the tolerance; under them those of the class."""
    sheets = sorted(found.sheets, key=lambda one: one.farthest)
    out = empty(2.6 + ROW * len(sheets))
    above, below = out.subplots(2, 1, sharex=True, height_ratios=(0.6 + ROW * len(sheets), 1.6))
    for place, sheet in enumerate(sheets):
        width = 2.0 * sheet.tolerance
        above.barh(place, width, 1.0, -sheet.tolerance, color=SHADE, zorder=0)
        for mark in sheet.marks:
            colour = web(BLUE if mark.within else VERMILION)
            face = "none" if mark.within else colour
            above.plot(mark.difference_percent, place, "o", mfc=face, mec=colour, clip_on=False)
        if not sheet.marks:
            above.text(0.0, place, "no answer", ha="center", va="center")
    names = [sheet.recorded.student or sheet.path.stem for sheet in sheets]
    above.set_yticks(range(len(sheets)), [name[:LETTERS] for name in names])
    above.set_ylim(len(sheets) - 0.4, -0.6)
    off = [mark.difference_percent for sheet in sheets for mark in sheet.marks]
    below.hist(off, BARS, color=web(BLUE))
    asked = sorted({LABS[sheet.recorded.lab].asked for sheet in sheets})
    below.set(xlabel=f"answer less true {' or '.join(asked)} [%]", ylabel="answers")
    below.yaxis.set_major_locator(MaxNLocator(integer=True))
    if len({sheet.tolerance for sheet in sheets}) == 1:
        below.axvspan(-sheets[0].tolerance, sheets[0].tolerance, color=SHADE, zorder=0)
    return out
