"""Orders over speed as a Rerun recording: Campbell diagrams, and the spectrum of each speed."""

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

#: Radii on the screen, and width of the plane, whose height is 100.
STROKE, CURSOR, WIDTH = -1.2, -0.8, 160.0
#: What the charts show.
CHARTS = {"rays": "orders over speed", "lines": "by order, at one speed"}
#: Room for half of the last mark, and for those below it, as shares of the width.
RIGHT, BELOW = 0.12, 0.1
#: From dark to bright, 0 to 255: a scale that is even in lightness.
SCALE = np.array(
    [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]], dtype=np.float64
)


def save_orders(
    found: Sequence[CamOrders], path: Path, titles: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Write the spectra of cams as a ``.rrd`` file that appears when it is whole."""
    tops = {quantity: loudest(found, quantity) for quantity in quantities_of(found)}
    rows = orders_tabs(found, titles)
    name = f"Orders of {', '.join(str(tab.name) for tab in rows)}"
    with chart_stream(path, name, rows, SPEED) as stream:
        for study in found:
            for quantity, most in tops.items():
                _draw_rays(stream, study, quantity, most)
                _draw_lines(stream, study, quantity, most)


def orders_tabs(found: Sequence[CamOrders], titles: Mapping[str, str]) -> list[rrb.Vertical]:
    """A tab for each cam: its diagrams, and below them the spectra of one speed."""
    tabs, tops = [], {quantity: loudest(found, quantity) for quantity in quantities_of(found)}
    for study in found:
        rays = [_chart(study, q, "rays", _ray_axes(study)) for q in tops]
        lines = [_chart(study, q, "lines", _line_axes(study, tops[q])) for q in tops]
        both, title = (rrb.Horizontal(*rays), rrb.Horizontal(*lines)), title_of(titles, study.cam)
        tabs.append(rrb.Vertical(*both, row_shares=[2, 1], name=title))
    return tabs


def entity(study: CamOrders, quantity: str, chart: str) -> str:
    """Where a chart of a cam is: "rays" over speed, or "lines" of one speed."""
    return f"orders/{study.cam}/{quantity}/{chart}"


def _chart(study: CamOrders, quantity: str, chart: str, axes: Axes) -> rrb.Spatial2DView:
    name, below = f"{QUANTITIES[quantity]}: {CHARTS[chart]}", BELOW * axes.width / axes.height
    return axes.view(entity(study, quantity, chart), name, RIGHT, below)


def _ray_axes(study: CamOrders) -> Axes:
    low, high = study.edges[[0, -1]]
    highest = max(float(spectrum.orders[-1]) for spectrum in study.spectra)
    return Axes((float(low), float(high)), (0.0, highest * float(high) / 60.0), WIDTH, raised=0.05)


def _line_axes(study: CamOrders, most: float) -> Axes:
    highest = max(float(spectrum.orders[-1]) for spectrum in study.spectra)
    top = 10.0 * np.ceil(most / 10.0)
    return Axes((0.0, highest), (float(top) - RANGE, float(top)), WIDTH, 0.4 * WIDTH, raised=0.09)


def _draw_rays(stream: rr.RecordingStream, study: CamOrders, quantity: str, most: float) -> None:
    """What is there at every speed; a level line stands at the stem's natural frequency."""
    axes, view = _ray_axes(study), entity(study, quantity, "rays")
    axes.draw(stream, f"{view}/axes", round_marks(*axes.x, "rpm"), round_marks(*axes.y, "Hz"))
    values = study.values(quantity)
    shown = values > most - RANGE
    strokes = study.strokes()[shown].reshape(-1, 2)
    places = axes.place(strokes[:, 0], strokes[:, 1]).reshape(-1, 2, 2)
    parts, at = (values[shown] - most) / RANGE + 1.0, np.linspace(0.0, 1.0, len(SCALE))
    shades = np.column_stack([np.interp(parts, at, scale) for scale in SCALE.T]).astype(np.uint8)
    strips = rr.LineStrips2D(list(places), colors=shades, radii=STROKE)
    stream.log(f"{view}/orders", strips, static=True)
    natural = study.spectra[0].steady.natural_frequency
    if natural is not None and natural < axes.y[1]:
        level = axes.place(np.array(axes.x), np.full(2, natural))
        line = rr.LineStrips2D([level], colors=colours.VERMILION, radii=CURSOR)
        stream.log(f"{view}/natural_frequency", line, static=True)


def _draw_lines(stream: rr.RecordingStream, study: CamOrders, quantity: str, most: float) -> None:
    """The spectrum of each speed, and in the rays a line at that speed."""
    axes, rays = _line_axes(study, most), _ray_axes(study)
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
        here = rays.place(np.full(2, spectrum.rpm), np.array(rays.y))
        cursor = rr.LineStrips2D([here], colors=colours.GREY, radii=CURSOR)
        stream.log(f"{entity(study, quantity, 'rays')}/speed", cursor)
