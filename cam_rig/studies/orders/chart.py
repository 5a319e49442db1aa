"""Rerun recording of orders: Campbell diagrams, and the spectrum at each speed.

An order is a frequency as a multiple of the cam's rotation frequency.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from cam_rig.show import looks as colours
from cam_rig.show.chart import SPEED, Axes, chart_stream, round_marks
from cam_rig.show.looks import title_of
from cam_rig.studies.orders.spectrum import QUANTITIES, RANGE, CamOrders, loudest, quantities_of

#: Line width of a curve as a radius in screen points. Rerun uses negative values for screen units.
STROKE = -1.2
#: Line width of the mark of the present speed, as a radius in screen points, negative as in
#: `STROKE`.
CURSOR = -0.8
#: Width of a chart in units of the Rerun view, in which the Campbell diagram is 100 high.
WIDTH = 160.0
#: Titles of the two kinds of chart: Campbell diagram with one ray per order over speed, and
#: spectrum at one speed.
CHARTS = {"rays": "orders over speed", "lines": "by order, at one speed"}
#: Free space at the right of a chart for half of the last axis label, as a fraction of the width.
RIGHT_MARGIN = 0.12
#: Free space below a chart for its axis labels, as a fraction of the width.
BOTTOM_MARGIN = 0.1
#: Colour map of levels from dark to bright, RGB from 0 to 255, with even steps of lightness.
SCALE = np.array(
    [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]], dtype=np.float64
)


def save_orders(
    studies: Sequence[CamOrders], path: Path, titles: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Write the spectra of cams as a Rerun recording (``.rrd``).

    The file appears only when it is complete. ``titles`` are the display names by cam.
    """
    tops = {quantity: loudest(studies, quantity) for quantity in quantities_of(studies)}
    tabs = orders_tabs(studies, titles)
    name = f"Orders of {', '.join(str(tab.name) for tab in tabs)}"
    with chart_stream(path, name, tabs, SPEED) as stream:
        for study in studies:
            for quantity, top in tops.items():
                _draw_rays(stream, study, quantity, top)
                _draw_lines(stream, study, quantity, top)


def orders_tabs(studies: Sequence[CamOrders], titles: Mapping[str, str]) -> list[rrb.Vertical]:
    """Return the tabs of the recording, one per cam.

    A tab has Campbell diagrams above the spectra at one speed, one column per quantity. ``studies``
    are the spectra of the cams, and ``titles`` the display names by cam.
    """
    tabs, tops = [], {quantity: loudest(studies, quantity) for quantity in quantities_of(studies)}
    for study in studies:
        rays = [_chart(study, q, "rays", _ray_axes(study)) for q in tops]
        lines = [_chart(study, q, "lines", _line_axes(study, tops[q])) for q in tops]
        rows, title = (rrb.Horizontal(*rays), rrb.Horizontal(*lines)), title_of(titles, study.cam)
        tabs.append(rrb.Vertical(*rows, row_shares=[2, 1], name=title))
    return tabs


def entity(study: CamOrders, quantity: str, chart: str) -> str:
    """Return the Rerun entity path of a chart of a cam.

    `quantity` is a key of `QUANTITIES`. `chart` is "rays" (Campbell diagram over speed) or "lines"
    (spectrum at one speed).
    """
    return f"orders/{study.cam}/{quantity}/{chart}"


def _chart(study: CamOrders, quantity: str, chart: str, axes: Axes) -> rrb.Spatial2DView:
    """Return the Rerun view of one chart, with its title.

    `chart` is "rays" (Campbell diagram over speed) or "lines" (spectrum at one speed), and
    `quantity` a key of `QUANTITIES`.
    """
    name, below = (
        f"{QUANTITIES[quantity]}: {CHARTS[chart]}",
        BOTTOM_MARGIN * axes.width / axes.height,
    )
    return axes.view(entity(study, quantity, chart), name, RIGHT_MARGIN, below)


def _ray_axes(study: CamOrders) -> Axes:
    """Return the axes of a Campbell diagram: cam speed (rpm) and frequency (Hz)."""
    low, high = study.edges[[0, -1]]
    highest = max(float(spectrum.orders[-1]) for spectrum in study.spectra)
    return Axes((float(low), float(high)), (0.0, highest * float(high) / 60.0), WIDTH, raised=0.05)


def _line_axes(study: CamOrders, highest_level: float) -> Axes:
    """Return the axes of a spectrum at one speed: order and level (dB).

    ``highest_level`` (dB) determines the range of the axis of levels.
    """
    highest = max(float(spectrum.orders[-1]) for spectrum in study.spectra)
    top = 10.0 * np.ceil(highest_level / 10.0)
    return Axes((0.0, highest), (float(top) - RANGE, float(top)), WIDTH, 0.4 * WIDTH, raised=0.09)


def _draw_rays(stream: rr.RecordingStream, study: CamOrders, quantity: str, top: float) -> None:
    """Draw the Campbell diagram of a cam, with a stroke per order and speed.

    The colour of a stroke is its level. `top` (dB) is the brightest level. The horizontal line is
    the natural frequency of the stem.
    """
    axes, view = _ray_axes(study), entity(study, quantity, "rays")
    axes.draw(stream, f"{view}/axes", round_marks(*axes.x, "rpm"), round_marks(*axes.y, "Hz"))
    values = study.values(quantity)
    is_shown = values > top - RANGE
    strokes = study.strokes()[is_shown].reshape(-1, 2)
    points = axes.place(strokes[:, 0], strokes[:, 1]).reshape(-1, 2, 2)
    fractions, nodes = (values[is_shown] - top) / RANGE + 1.0, np.linspace(0.0, 1.0, len(SCALE))
    shades = np.column_stack([np.interp(fractions, nodes, scale) for scale in SCALE.T]).astype(
        np.uint8
    )
    strips = rr.LineStrips2D(list(points), colors=shades, radii=STROKE)
    stream.log(f"{view}/orders", strips, static=True)
    natural = study.spectra[0].steady.natural_frequency
    if natural is not None and natural < axes.y[1]:
        level = axes.place(np.array(axes.x), np.full(2, natural))
        line = rr.LineStrips2D([level], colors=colours.VERMILION, radii=CURSOR)
        stream.log(f"{view}/natural_frequency", line, static=True)


def _draw_lines(stream: rr.RecordingStream, study: CamOrders, quantity: str, top: float) -> None:
    """Draw the spectrum at each speed, and mark the speed in the Campbell diagram.

    `top` (dB) is the highest level of all cams, from which the axis is scaled.
    """
    axes, rays = _line_axes(study, top), _ray_axes(study)
    view = entity(study, quantity, "lines")
    axes.draw(stream, f"{view}/axes", round_marks(*axes.x, ""), round_marks(*axes.y, "dB"))
    for spectrum in study.spectra:
        stream.set_time(SPEED, sequence=round(spectrum.rpm))
        values = np.clip(getattr(spectrum, quantity)[1:], *axes.y)
        ends = [
            axes.place(spectrum.orders[1:], v) for v in (np.full_like(values, axes.y[0]), values)
        ]
        bars = list(np.stack(ends, axis=1))
        stream.log(f"{view}/orders", rr.LineStrips2D(bars, colors=colours.BLUE, radii=STROKE))
        line = rays.place(np.full(2, spectrum.rpm), np.array(rays.y))
        cursor = rr.LineStrips2D([line], colors=colours.GREY, radii=CURSOR)
        stream.log(f"{entity(study, quantity, 'rays')}/speed", cursor)
