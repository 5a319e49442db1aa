"""Orders over speed as rays of a Campbell diagram; of one speed, as lines over the order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from cam_rig.arrays import FloatArray
from cam_rig.plots.figures import CAM_SPEED, empty, line, write
from cam_rig.schema.scene import MODEL_ALIASES
from cam_rig.studies.orders.spectrum import OrderSpectrum
from cam_rig.studies.orders.waterfall import CamOrders

Quantity = Callable[[OrderSpectrum], FloatArray]
#: dB between the brightest and the darkest.
RANGE = 60.0
#: Orders that are named at the edge, at most.
NAMED = 8
#: The field's names of the models that have another one.
MODELS = {name: model for model, name in MODEL_ALIASES.items()}
COLOURS, GROUND = "viridis", "0.12"


def draw(found: Sequence[CamOrders], path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    write(figure(found), path)


def figure(found: Sequence[CamOrders]) -> Figure:
    """A row for each cam: force on the left, sound on the right."""
    out = empty(11.0, 4.2 * len(found) + 0.4)
    panels = out.subplots(len(found), 2, squeeze=False)
    top = [max(quantity(s)[1:].max() for c in found for s in c.spectra) for quantity in QUANTITIES]
    for row, study in enumerate(found):
        one = len(study.spectra) == 1
        for axes, quantity, name, most in zip(panels[row], QUANTITIES, NAMES, top, strict=True):
            model = MODELS.get(study.model, study.model)
            axes.set_title(f"{study.cam}, {model}: {name.partition(' [')[0]}", fontsize=10)
            if one:
                _lines(axes, study.spectra[0], quantity(study.spectra[0]), name, most)
            else:
                rays = _rays(axes, study, quantity, most)
                out.colorbar(rays, ax=axes, label=name, extend="min")
    return out


def _force_db(spectrum: OrderSpectrum) -> FloatArray:
    """Amplitude of the force, dB re 1 N."""
    return np.asarray(20.0 * np.log10(np.maximum(spectrum.amplitude, 1e-15)))


def _sound_db(spectrum: OrderSpectrum) -> FloatArray:
    return spectrum.level


QUANTITIES = (_force_db, _sound_db)
NAMES = ("contact force [dB re 1 N]", "sound [dB re 20 µPa]")


def _lines(axes: Axes, spectrum: OrderSpectrum, level: FloatArray, name: str, most: float) -> None:
    low = most - RANGE
    axes.vlines(spectrum.orders[1:], low, level[1:], color=line(0)["color"], lw=1.4)
    axes.set(xlabel=f"order of the cam, {spectrum.rpm:g} rpm", ylabel=name)
    axes.set(ylim=(low, most + 4.0), xlim=(0.0, spectrum.orders[-1] + 1.0))
    axes.grid(alpha=0.25)


def _rays(
    axes: Axes, study: CamOrders, quantity: Callable[[OrderSpectrum], FloatArray], most: float
) -> LineCollection:
    """A short stroke for each order at each speed: the strokes of an order lie on its ray.

    Dashed: the natural frequency of the stem.
    """
    rpm = np.array([spectrum.rpm for spectrum in study.spectra])
    edges = np.concatenate(
        ([1.5 * rpm[0] - 0.5 * rpm[1]], 0.5 * (rpm[1:] + rpm[:-1]), [1.5 * rpm[-1] - 0.5 * rpm[-2]])
    )
    strokes, levels = [], []
    for spectrum, left, right in zip(study.spectra, edges[:-1], edges[1:], strict=True):
        per_rpm = spectrum.orders[1:] / 60.0
        ends = [np.column_stack([np.full_like(per_rpm, x), per_rpm * x]) for x in (left, right)]
        strokes.append(np.stack(ends, axis=1))
        levels.append(quantity(spectrum)[1:])
    shades = colormaps[COLOURS].with_extremes(under=GROUND)
    rays = LineCollection(list(np.concatenate(strokes)), cmap=shades, lw=1.6)
    rays.set_array(np.concatenate(levels))
    rays.set_clim(most - RANGE, most)
    axes.add_collection(rays)
    highest = study.spectra[-1].orders[-1]
    axes.set(xlabel=CAM_SPEED, ylabel="frequency [Hz]", facecolor=GROUND)
    axes.set(xlim=(edges[0], edges[-1]), ylim=(0.0, highest * edges[-1] / 60.0))
    natural = study.spectra[0].steady.natural_frequency
    if natural is not None and natural < axes.get_ylim()[1]:
        axes.axhline(natural, color="w", ls="--", lw=0.8)
    for order in _named(highest):
        words = f"{order:g}" if order < _named(highest)[-1] else f"order {order:g}"
        place = (edges[-1], order * edges[-1] / 60.0)
        axes.annotate(words, place, xytext=(2, 0), textcoords="offset points", fontsize=7)
    return rays


def _named(highest: float) -> FloatArray:
    step = next(s for s in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000) if highest / s <= NAMED + 2)
    return np.arange(step, highest + 0.5, step)
