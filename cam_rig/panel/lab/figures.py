"""A class's lab sheets at a glance: how far each student's readings are from the true speeds."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from cam_rig.panel.lab.marking import MarksResult
from cam_rig.show.figure import empty, styled
from cam_rig.show.looks import BLUE, VERMILION, web

#: A name is cut after so many letters; inches a student; bars of the histogram.
LETTERS, ROW, BARS = 26, 0.26, 31


@styled
def marks_figure(found: MarksResult) -> Figure:
    """Readings a row a sheet, the widest apart below; under them all readings of the class.

    A full marker is a reading beyond the tolerance, which is shaded.
    """
    sheets = sorted(found.sheets, key=lambda one: max(abs(m.difference_percent) for m in one.marks))
    out = empty(2.6 + ROW * len(sheets))
    above, below = out.subplots(2, 1, sharex=True, height_ratios=(0.6 + ROW * len(sheets), 1.6))
    for place, sheet in enumerate(sheets):
        for mark in sheet.marks:
            colour = web(BLUE if mark.within else VERMILION)
            face = "none" if mark.within else colour
            above.plot(mark.difference_percent, place, "o", mfc=face, mec=colour, clip_on=False)
    names = [sheet.recorded.student or sheet.path.stem for sheet in sheets]
    above.set_yticks(range(len(sheets)), [name[:LETTERS] for name in names])
    above.set_ylim(len(sheets) - 0.4, -0.6)
    off = [mark.difference_percent for sheet in sheets for mark in sheet.marks]
    below.hist(off, BARS, color=web(BLUE))
    below.set(xlabel="reading less true jump speed [%]", ylabel="readings")
    below.yaxis.set_major_locator(MaxNLocator(integer=True))
    for axes in (above, below):
        axes.axvspan(-sheets[0].tolerance, sheets[0].tolerance, color="0.92", zorder=0)
    return out
