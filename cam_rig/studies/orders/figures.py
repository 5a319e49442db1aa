"""Figures of orders: Campbell diagram over speed, or spectrum at one speed.

An order is a frequency as a multiple of the cam's rotation frequency.
"""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from cam_rig.show.figure import CAM_SPEED, colour, empty, styled
from cam_rig.show.looks import title_of
from cam_rig.studies.orders.spectrum import RANGE, CamOrders, loudest, quantities_of
from cam_rig.studies.orders.study import OrdersResult
from cam_rig.units import FloatArray

#: Approximate largest number of orders that are labelled at the right edge of a Campbell diagram.
MAX_LABELS = 8
#: Name of the matplotlib colour map for levels.
COLOURS = "viridis"
#: Grey level of the background, and of values below the displayed range (0 black, 1 white).
GROUND = "0.12"


@styled
def figure(result: OrdersResult) -> Figure:
    """Draw the orders of force (left) and sound (right), with one row per cam.

    At several speeds the panels are Campbell diagrams, at one speed they are spectra.
    """
    studies, titles = result.studies, result.titles
    drawing = empty(2.9 * len(studies) + 0.3)
    quantities = quantities_of(studies)
    panels = drawing.subplots(len(studies), len(quantities), squeeze=False)
    for column, (quantity, name) in enumerate(quantities.items()):
        highest = loudest(studies, quantity)
        for study, axes in zip(studies, panels[:, column], strict=True):
            quantity_name, model = name.partition(" [")[0], study.model
            title, model = title_of(titles, study.cam), model.replace("_", " ")
            axes.set_title(f"{title}\n{model}: {quantity_name}")
            if len(study.spectra) == 1:
                _lines(axes, study, study.values(quantity), name, highest)
            else:
                rays = _rays(axes, study, study.values(quantity), highest)
                drawing.colorbar(rays, ax=axes, label=name, extend="min")
    return drawing


def _lines(axes: Axes, study: CamOrders, values: FloatArray, name: str, highest: float) -> None:
    """Draw the spectrum of a cam at its only speed.

    ``values`` are the values of the orders in dB, and ``name`` is that of the quantity. ``highest``
    (dB) determines the range of the axis, which is `RANGE` dB below it.
    """
    spectrum, low = study.spectra[0], highest - RANGE
    axes.vlines(spectrum.orders[1:], low, values, color=colour(study.cam))
    axes.set(xlabel=f"order of the cam, {spectrum.rpm:g} rpm", ylabel=name)
    axes.set(ylim=(low, highest + 4.0), xlim=(0.0, spectrum.orders[-1] + 1.0))


def _rays(axes: Axes, study: CamOrders, values: FloatArray, top: float) -> LineCollection:
    """Draw a Campbell diagram, with a stroke per order and speed.

    The colour of a stroke is its value (dB). `top` (dB) is the upper end of the colour scale. The
    strokes of an order form a ray. The dashed line is the natural frequency of the stem.
    """
    shades = colormaps[COLOURS].with_extremes(under=GROUND)
    rays = LineCollection(list(study.strokes()), cmap=shades)
    rays.set_array(values)
    rays.set_clim(top - RANGE, top)
    rays.set_rasterized(True)  # an SVG of thousands of strokes would have megabytes
    axes.add_collection(rays)
    low, high = study.edges[[0, -1]]
    highest = float(study.spectra[-1].orders[-1])
    axes.set(xlabel=CAM_SPEED, ylabel="frequency [Hz]", facecolor=GROUND)
    axes.grid(visible=False)
    axes.set(xlim=(low, high), ylim=(0.0, highest * high / 60.0))
    natural = study.spectra[0].steady.natural_frequency
    if natural is not None and natural < axes.get_ylim()[1]:
        axes.axhline(natural, color="w", ls="--", lw=0.8)
    step = next(
        s for s in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000) if highest / s <= MAX_LABELS + 2
    )
    labelled = np.arange(step, highest + 0.5, step)
    for order in labelled:
        text = f"order {order:g}" if order == labelled[0] else f"{order:g}"
        position = (high, order * high / 60.0)
        axes.annotate(text, position, (2, 0), textcoords="offset points", va="center")
    return rays
