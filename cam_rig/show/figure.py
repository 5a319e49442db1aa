"""What all figures on paper share: the style sheet, an empty figure, axes, looks of cams.

Figures are made without pyplot: they need no screen and change nothing of matplotlib's state.
Looks can be told apart in print and by the colour-blind.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from textwrap import wrap
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from cam_rig.errors import CONTROLS, printable
from cam_rig.show.looks import DASHES, GAP, MARKERS, SERIES, cam_look, log_tick, web
from cam_rig.units import FloatArray

CAM_ANGLE, CAM_SPEED = "cam angle θ [°]", "cam speed [rpm]"
LEVEL = "sound pressure level [dB re 20 µPa]"
#: Width of a figure in inches: 170 mm, the text of an A4 page.
WIDTH = 170.0 / 25.4
#: Read once. `styled` has a function draw in it; what matplotlib is set to elsewhere stays.
STYLE = mpl.rc_params_from_file(
    Path(__file__).with_name("style.mplstyle"), use_default_template=False
)

styled = mpl.rc_context(STYLE)

#: Letters of a line over a whole figure, at most.
ACROSS = 72
#: A logarithmic axis over more decades than this has no ticks at 3.
DECADES = 3.5
#: Of the side of a panel, between two markers of a curve.
MARKER_GAP = 0.14


def empty(height: float) -> Figure:
    """A figure of a page's width without axes; its height in inches."""
    return Figure(figsize=(WIDTH, height), layout="constrained")


@styled
def write(
    figure: Figure, to: Path | BytesIO, dpi: float | None = None, part: Bbox | None = None
) -> None:
    """Write a figure, or a ``part`` in inches from its lower left; to memory as SVG."""
    _escape_controls(figure)
    dpi = STYLE["savefig.dpi"] if dpi is None else dpi
    kind = None if isinstance(to, Path) else "svg"
    figure.savefig(to, dpi=dpi, bbox_inches=part, format=kind)


def _escape_controls(figure: Figure) -> None:
    """Escape control characters of titles, which matplotlib would print in warnings."""
    for text in figure.findobj(Text):
        if CONTROLS.search(text.get_text()):
            text.set_text(printable(text.get_text()))


def logarithmic(*axes: Axis) -> None:
    """Ticks at 1, 3, 10 of each axis, at decades where it has many; numbers written out."""
    for axis in axes:
        low, high = axis.get_view_interval()
        wide = math.log10(high / low) > DECADES
        axis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 3.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: log_tick(value)))
        axis.set_minor_formatter(NullFormatter())


def wrapped(title: str, letters: int = ACROSS) -> str:
    """The words over a whole figure, in lines that it holds; or of fewer letters, over a part."""
    return "\n".join(line for words in title.split("\n") for line in wrap(words, letters) or [""])


def turn_axis(axes: Axes, step: int = 60) -> None:
    """One turn along x, marked every ``step`` degrees."""
    axes.set(xlim=(0.0, 360.0), xticks=range(0, 361, step))


def shade(axes: Axes, x: FloatArray, where: NDArray[np.bool_], label: str | None = None) -> None:
    """Shade the whole height of the axes along ``x`` ``(n,)``, as where contact is lost."""
    axes.fill_between(
        x,
        0.0,
        1.0,
        where=where.tolist(),
        transform=axes.get_xaxis_transform(),
        color=web(GAP),
        alpha=0.15,
        lw=0.0,
        label=label,
    )


def line(cam: str) -> dict[str, Any]:
    """What a line of a cam, or of a named rise, is drawn with, by its name."""
    look = cam_look(cam)
    style = {"color": web(look.colour), "ls": look.dash}
    if look.marked:
        style |= {"marker": look.marker, "ms": 4.0, "markevery": MARKER_GAP}
    return style


def marker(cam: str) -> dict[str, Any]:
    """What points of a cam are drawn with, by its name."""
    return {"color": colour(cam), "marker": cam_look(cam).marker}


def colour(cam: str) -> str:
    """Colour of a cam by its name, the same as in the viewer."""
    return web(cam_look(cam).colour)


def series(index: int) -> dict[str, Any]:
    """Colour and dash of the index-th of several curves that are no cams."""
    return {"color": web(SERIES[index % len(SERIES)]), "ls": DASHES[index % len(DASHES)]}


def series_marker(index: int) -> dict[str, Any]:
    """Colour and marker of the index-th of several curves that are no cams."""
    return {"color": web(SERIES[index % len(SERIES)]), "marker": MARKERS[index % len(MARKERS)]}


# A tall figure in strips between its rows of panels, so that paper may part it there.

#: Height of a strip in inches, if its panels are not higher: a third of an A4 page's text.
STRIP = 3.4
#: Inches by which rows may overlap: boxes of glyphs are rounded up.
TOUCH = 0.02


@styled
def strips(figure: Figure) -> list[tuple[float, float]]:
    """From and to of each strip, inches above the foot of the figure, the highest strip first.

    What stands above and below all panels goes with the nearest. The figure's layout is done, and
    stays as it is from then on.
    """
    _escape_controls(figure)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    panels = [span for artist, span in _parts(figure) if isinstance(artist, Axes)]
    rows: list[list[float]] = []
    for low, high in sorted(panels, key=lambda span: -span[1]):
        if rows and high > rows[-1][0] + TOUCH:
            rows[-1][0] = min(low, rows[-1][0])
        else:
            rows.append([low, high])
    cuts = [figure.get_figheight()]
    for above, row in pairwise(rows):
        if cuts[-1] - row[0] > STRIP:
            cuts.append(0.5 * (above[0] + row[1]))
    return list(zip([*cuts[1:], 0.0], cuts, strict=True))


def write_strip(
    figure: Figure, low: float, high: float, to: Path | BytesIO, dpi: float | None
) -> None:
    """Write one of the `strips`; what is outside of it is left out of the file too."""
    outside = [a for a, span in _parts(figure) if not low <= 0.5 * (span[0] + span[1]) <= high]
    for artist in outside:
        artist.set_visible(False)
    write(figure, to, dpi, Bbox([[0.0, low], [figure.get_figwidth(), high]]))
    for artist in outside:
        artist.set_visible(True)


def _parts(figure: Figure) -> Iterator[tuple[Artist, tuple[float, float]]]:
    """Panels, legends and words of a figure that are seen, and their heights in inches."""
    for artist in (*figure.axes, *figure.legends, *figure.texts):
        box = artist.get_tightbbox() if artist.get_visible() else None
        if box is not None:
            yield artist, (box.y0 / figure.dpi, box.y1 / figure.dpi)
