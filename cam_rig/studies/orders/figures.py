"""Orders over speed as rays of a Campbell diagram; of one speed, as lines over the order."""

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

#: Orders that are named at the edge, at most.
NAMED = 8
COLOURS, GROUND = "viridis", "0.12"


@styled
def figure(result: OrdersResult) -> Figure:
    """A row for each cam, by its title where it is given: force on the left, sound on the right."""
    found, titles = result.studies, result.titles
    out = empty(2.9 * len(found) + 0.3)
    quantities = quantities_of(found)
    panels = out.subplots(len(found), len(quantities), squeeze=False)
    for column, (quantity, name) in enumerate(quantities.items()):
        most = loudest(found, quantity)
        for study, axes in zip(found, panels[:, column], strict=True):
            what, model = name.partition(" [")[0], study.model
            title, model = title_of(titles, study.cam), model.replace("_", " ")
            axes.set_title(f"{title}\n{model}: {what}")
            if len(study.spectra) == 1:
                _lines(axes, study, study.values(quantity), name, most)
            else:
                rays = _rays(axes, study, study.values(quantity), most)
                out.colorbar(rays, ax=axes, label=name, extend="min")
    return out


def _lines(axes: Axes, study: CamOrders, values: FloatArray, name: str, most: float) -> None:
    spectrum, low = study.spectra[0], most - RANGE
    axes.vlines(spectrum.orders[1:], low, values, color=colour(study.cam))
    axes.set(xlabel=f"order of the cam, {spectrum.rpm:g} rpm", ylabel=name)
    axes.set(ylim=(low, most + 4.0), xlim=(0.0, spectrum.orders[-1] + 1.0))


def _rays(axes: Axes, study: CamOrders, values: FloatArray, most: float) -> LineCollection:
    """The strokes of an order lie on its ray. Dashed: the natural frequency of the stem."""
    shades = colormaps[COLOURS].with_extremes(under=GROUND)
    rays = LineCollection(list(study.strokes()), cmap=shades)
    rays.set_array(values)
    rays.set_clim(most - RANGE, most)
    rays.set_rasterized(True)  # thousands of strokes, of which an SVG would be megabytes
    axes.add_collection(rays)
    low, high = study.edges[[0, -1]]
    highest = float(study.spectra[-1].orders[-1])
    axes.set(xlabel=CAM_SPEED, ylabel="frequency [Hz]", facecolor=GROUND)
    axes.grid(visible=False)
    axes.set(xlim=(low, high), ylim=(0.0, highest * high / 60.0))
    natural = study.spectra[0].steady.natural_frequency
    if natural is not None and natural < axes.get_ylim()[1]:
        axes.axhline(natural, color="w", ls="--", lw=0.8)
    step = next(s for s in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000) if highest / s <= NAMED + 2)
    named = np.arange(step, highest + 0.5, step)
    for order in named:
        words = f"order {order:g}" if order == named[0] else f"{order:g}"  # far from the title
        place = (high, order * high / 60.0)
        axes.annotate(words, place, (2, 0), textcoords="offset points", va="center")
    return rays
