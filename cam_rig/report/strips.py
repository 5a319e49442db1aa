"""A tall figure in strips between its rows of panels, so that paper may part it there."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from cam_rig.plots.figures import styled, write

#: Height of a strip in inches, if its panels are not higher: a third of an A4 page's text.
STRIP = 3.4
#: Inches by which rows may overlap: boxes of glyphs are rounded up.
TOUCH = 0.02


@styled
def strips(figure: Figure, most: float = STRIP) -> list[tuple[float, float]]:
    """From and to of each strip, inches above the foot of the figure, the highest strip first.

    What stands above and below all panels goes with the nearest. The figure's layout is done, and
    stays as it is from then on.
    """
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
        if cuts[-1] - row[0] > most:
            cuts.append(0.5 * (above[0] + row[1]))
    return list(zip([*cuts[1:], 0.0], cuts, strict=True))


def write_strip(figure: Figure, low: float, high: float, path: Path, dpi: float | None) -> None:
    """Write one of the `strips`; what is outside of it is left out of the file too."""
    outside = [a for a, span in _parts(figure) if not low <= 0.5 * (span[0] + span[1]) <= high]
    for artist in outside:
        artist.set_visible(False)
    write(figure, path, dpi, Bbox([[0.0, low], [figure.get_figwidth(), high]]))
    for artist in outside:
        artist.set_visible(True)


def _parts(figure: Figure) -> Iterator[tuple[Artist, tuple[float, float]]]:
    """Panels, legends and words of a figure that are seen, and their heights in inches."""
    for artist in (*figure.axes, *figure.legends, *figure.texts):
        box = artist.get_tightbbox() if artist.get_visible() else None
        if box is not None:
            yield artist, (box.y0 / figure.dpi, box.y1 / figure.dpi)
