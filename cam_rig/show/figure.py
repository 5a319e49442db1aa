"""Common parts of figures on paper: style sheet, figure, axes and curves.

Figures are made without pyplot. They do not need a screen, and do not change the state of
matplotlib. Cams can be distinguished in print and by colour-blind readers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from textwrap import wrap
from typing import Any, cast

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from cam_rig.errors import CONTROLS, ConfigError, printable
from cam_rig.show.looks import DASHES, GAP, MARKERS, SERIES, cam_look, log_tick, web
from cam_rig.units import FloatArray

#: Label of an axis of cam angles.
CAM_ANGLE = "cam angle θ [°]"
#: Label of an axis of cam speeds.
CAM_SPEED = "cam speed [rpm]"
#: Label of an axis of sound levels.
LEVEL = "sound pressure level [dB re 20 µPa]"
#: Width of a figure in inches: 170 mm, the width of the text on an A4 page.
WIDTH = 170.0 / 25.4
#: Matplotlib's parameters for all figures, from the style sheet.
STYLE = mpl.rc_params_from_file(
    Path(__file__).with_name("style.mplstyle"), use_default_template=False
)

#: Decorator: the function draws with `STYLE`. Matplotlib's parameters are restored afterwards.
styled = mpl.rc_context(STYLE)

#: Largest number of characters of a title line across a whole figure.
ACROSS = 72
#: Largest number of decades of a logarithmic axis with ticks at 3, 30, ... in addition to the
#: powers of ten. On a longer axis these ticks would overlap.
MAX_DECADES = 3.5
#: Distance of two markers of a curve, as a fraction of the diagonal of its panel.
MARKER_GAP = 0.14


#: Part of a user's figure into which a figure is drawn, or None for a new figure.
_TARGET: ContextVar[SubFigure | None] = ContextVar("_TARGET", default=None)


def empty(height: float) -> Figure:
    """Return a figure without axes, with the width of a page and a height in inches.

    Within `draw_into` it is the part of the user's figure.
    """
    if (target := _TARGET.get()) is not None:
        return cast(Figure, target)
    return Figure(figsize=(WIDTH, height), layout="constrained")


def draw_into(axes: Axes | None, draw: Callable[[], Figure]) -> Figure:
    """Call a function that draws a figure, and return the figure.

    If `axes` are not None, they are replaced by a part of their figure, into which the function
    draws. The part may contain several panels.

    Raises
    ------
    ConfigError
        If the axes are not in a grid, as those of ``plt.subplots`` are.
    """
    if axes is None:
        return draw()
    position, parent, figure = axes.get_subplotspec(), axes.figure, axes.get_figure(root=True)
    if position is None or figure is None:
        raise ConfigError("ax must be axes of a grid, as plt.subplots or add_subplot returns")
    axes.remove()
    token = _TARGET.set(parent.add_subfigure(position))
    try:
        draw()
    finally:
        _TARGET.reset(token)
    return figure


@styled
def write(
    figure: Figure, to: Path | BytesIO, dpi: float | None = None, part: Bbox | None = None
) -> None:
    """Write a figure, or a rectangular part of it, to a file or to memory.

    Parameters
    ----------
    figure : Figure
        Figure of Matplotlib.
    to : Path or BytesIO
        File with the format of its suffix, or memory for SVG.
    dpi : float, optional
        Resolution (default: that of the style sheet).
    part : Bbox, optional
        Box in inches from the lower left corner (default: the whole figure).
    """
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
    """Set the ticks of logarithmic axes to 1, 3, 10, 30 and so on.

    Axes of more than `MAX_DECADES` decades get ticks at powers of ten only.
    """
    for axis in axes:
        low, high = axis.get_view_interval()
        is_wide = math.log10(high / low) > MAX_DECADES
        axis.set_major_locator(LogLocator(subs=(1.0,) if is_wide else (1.0, 3.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: log_tick(value)))
        axis.set_minor_formatter(NullFormatter())


def wrapped(title: str, width: int = ACROSS) -> str:
    """Return a title in lines of up to `width` characters."""
    return "\n".join(line for text in title.split("\n") for line in wrap(text, width) or [""])


def turn_axis(axes: Axes, step: int = 60) -> None:
    """Set the x axis to one turn in degrees, with a tick every `step` degrees."""
    axes.set(xlim=(0.0, 360.0), xticks=range(0, 361, step))


def shade(axes: Axes, x: FloatArray, where: NDArray[np.bool_], label: str | None = None) -> None:
    """Shade the whole height of the axes, in the colour of lost contact.

    `where` `(n,)` is True at the values of `x` `(n,)` that are shaded.
    """
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
    """Return the plot options of a cam's curve, by the name of the cam.

    The name may also be that of a rise, the motion law of a single segment of a cam.
    """
    look = cam_look(cam)
    style = {"color": web(look.colour), "ls": look.dash}
    if look.marked:
        style |= {"marker": look.marker, "ms": 4.0, "markevery": MARKER_GAP}
    return style


def marker(cam: str) -> dict[str, Any]:
    """Return the plot options of points of a cam, by its name."""
    return {"color": colour(cam), "marker": cam_look(cam).marker}


def colour(cam: str) -> str:
    """Return the colour of a cam by its name, the same as in the viewer."""
    return web(cam_look(cam).colour)


def series(index: int) -> dict[str, Any]:
    """Return colour and dash of a curve that does not stand for a cam.

    `index` is the number of the curve in its figure, from 0.
    """
    return {"color": web(SERIES[index % len(SERIES)]), "ls": DASHES[index % len(DASHES)]}


def series_marker(index: int) -> dict[str, Any]:
    """Return colour and marker of points that do not stand for a cam.

    `index` is the number of the series in its figure, from 0.
    """
    return {"color": web(SERIES[index % len(SERIES)]), "marker": MARKERS[index % len(MARKERS)]}


# Division of a tall figure into strips of panels, between which a page may break.

#: Height (in) of a strip of a figure, a part that a page can contain: a third of the text of an A4
#: page. A strip with higher panels is higher.
STRIP_HEIGHT_IN = 3.4
#: Largest overlap (in) of two rows of panels between which a page may still break. Rows can overlap
#: slightly, because the boxes of texts are rounded up.
MAX_OVERLAP_IN = 0.02


@styled
def strips(figure: Figure) -> list[tuple[float, float]]:
    """Return the lower and upper end of each strip of a figure, from top to bottom.

    A strip contains whole panels, so that a page may break between two strips. The ends are in
    inches above the lower edge of the figure. Texts above and below all panels
    belong to the nearest strip. The layout of the figure is computed here, and fixed afterwards.
    """
    _escape_controls(figure)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    panels = [span for artist, span in _visible_artists(figure) if isinstance(artist, Axes)]
    rows: list[list[float]] = []
    for low, high in sorted(panels, key=lambda span: -span[1]):
        if rows and high > rows[-1][0] + MAX_OVERLAP_IN:
            rows[-1][0] = min(low, rows[-1][0])
        else:
            rows.append([low, high])
    cuts = [figure.get_figheight()]
    for upper, lower in pairwise(rows):
        if cuts[-1] - lower[0] > STRIP_HEIGHT_IN:
            cuts.append(0.5 * (upper[0] + lower[1]))
    return list(zip([*cuts[1:], 0.0], cuts, strict=True))


def write_strip(
    figure: Figure, low: float, high: float, to: Path | BytesIO, dpi: float | None
) -> None:
    """Write the strip of a figure between two heights to a file or to memory.

    `low` and `high` are the ends of the strip from `strips`, in inches. The other parameters are
    those of `write`.
    """
    spans = _visible_artists(figure)
    outside = [artist for artist, span in spans if not low <= 0.5 * (span[0] + span[1]) <= high]
    for artist in outside:
        artist.set_visible(False)
    write(figure, to, dpi, Bbox([[0.0, low], [figure.get_figwidth(), high]]))
    for artist in outside:
        artist.set_visible(True)


def _visible_artists(figure: Figure) -> Iterator[tuple[Artist, tuple[float, float]]]:
    """Yield visible panels, legends and texts with their lower and upper end, inches."""
    for artist in (*figure.axes, *figure.legends, *figure.texts):
        box = artist.get_tightbbox() if artist.get_visible() else None
        if box is not None:
            yield artist, (box.y0 / figure.dpi, box.y1 / figure.dpi)
