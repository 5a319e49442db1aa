"""Check of a figure for print: text that is cut off, overlaps or is too small."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import combinations
from typing import Any

import pytest
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

#: Smallest font size (pt) that a printed figure may have.
SMALLEST = 7.0
#: Largest width (in) that a printed figure may have: 170 mm.
WIDEST = 170.0 / 25.4
#: Pattern of a negative number with a hyphen instead of a minus sign, which is a fault.
HYPHEN = re.compile(r"(?<![\w-])-\d")
#: Pattern of an exponent such as 1e-3 that is not typeset as a power, which is a fault.
EXPONENT = re.compile(r"\de[+-]?\d")
#: Allowed overlap of two boxes of text (px), because boxes are rounded up to pixels.
TOUCH = 1.0


def faults(figure: Figure) -> list[str]:
    """Return a line for each fault of a figure, and no line for a printable figure."""
    figure.draw_without_rendering()
    found = [] if figure.get_figwidth() <= WIDEST + 1e-9 else ["wider than 170 mm"]
    texts = [text for text in figure.findobj(Text) if text.get_text().strip()]
    for text in texts:
        words = text.get_text()
        if text.get_visible() and text.get_fontsize() < SMALLEST:
            found.append(f"{words!r}: {text.get_fontsize():g} pt")
        if HYPHEN.search(words) or EXPONENT.search(words):
            found.append(f"{words!r}: not typeset")
    labels = list(_labels(figure))
    boxes = [
        (text, Text.get_window_extent(text)) for text in labels
    ]  # without the arrow of an annotation
    page = figure.bbox.padded(TOUCH)
    for text, box in boxes:
        if not (
            page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1
        ):
            found.append(f"{text.get_text()!r}: cut")
    panels = [axes for axes in figure.findobj(Axes) if axes.get_visible() and axes.axison]
    for axes in panels:
        legend = axes.get_legend()
        others = [other.bbox for other in panels if other is not axes]
        others += [box for text, box in boxes if not legend or text not in legend.get_texts()]
        if legend and any(_overlap(legend.get_window_extent(), other) for other in others):
            found.append(
                f"a legend on another panel or label: {legend.get_texts()[0].get_text()!r}"
            )
    for (one, box), (other, beside) in combinations(boxes, 2):
        if _overlap(box, beside):
            found.append(f"{one.get_text()!r} on {other.get_text()!r}")
    return found


@pytest.fixture(autouse=True)
def no_faulty_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that every figure that a test writes to a file is printable."""
    save = Figure.savefig

    def checked(figure: Figure, *given: Any, **more: Any) -> None:
        save(figure, *given, **more)
        assert faults(figure) == []

    monkeypatch.setattr(Figure, "savefig", checked)


def _labels(figure: Figure) -> Iterator[Text]:
    """Yield the visible texts: tick labels, axis labels, titles, legends, annotations."""
    for axes in figure.findobj(Axes):
        if axes.get_visible() and axes.axison:
            texts = [child for child in axes.get_children() if isinstance(child, Text)]
            texts += [axes.xaxis.label, axes.yaxis.label]
            for axis in (axes.xaxis, axes.yaxis):
                texts += [*_ticks(axis), axis.get_offset_text()]
            yield from (text for text in texts if text.get_visible() and text.get_text().strip())
            if axes.get_legend():
                yield from axes.get_legend().get_texts()
    for part in (figure, *figure.subfigs):
        for legend in part.legends:
            yield from legend.get_texts()
        yield from (text for text in part.texts if text.get_text().strip())


def _ticks(axis: Axis) -> Iterator[Text]:
    low, high = sorted(axis.get_view_interval())
    room = 1e-9 * (high - low)
    for tick in axis.get_major_ticks():
        if low - room <= tick.get_loc() <= high + room:
            yield from (text for text in (tick.label1, tick.label2) if text.get_visible())


def _overlap(one: Bbox, other: Bbox) -> bool:
    width = min(one.x1, other.x1) - max(one.x0, other.x0)
    height = min(one.y1, other.y1) - max(one.y0, other.y0)
    return width > TOUCH and height > TOUCH
