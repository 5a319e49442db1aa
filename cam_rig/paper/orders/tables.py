"""Orders of force and sound as tables: speed by speed, and order by order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from cam_rig.paper.orders.spectrum import CamOrders, OrderSpectrum
from cam_rig.show.tables import Cell, DataTable, Head, tabulate

#: So many of the loudest orders are named.
LOUDEST = 2

#: A cam's name and one of its spectra.
Row = tuple[str, OrderSpectrum]

#: The same with the place of an order in it.
OrderRow = tuple[str, OrderSpectrum, int]


def speed_table(found: Iterable[CamOrders], titles: Mapping[str, str] | None = None) -> DataTable:
    """A row for each cam and speed: mean force, sound of all orders, the loudest of them.

    ``titles`` are what cams are called, where not by name.
    """
    rows, called = list(_spectra(found)), titles or {}
    highest = max((spectrum.orders[-1] for _, spectrum in rows), default=0.0)
    lands = any(spectrum.steady.landings for _, spectrum in rows)
    unsettled = any(not spectrum.steady.settled for _, spectrum in rows)
    return tabulate(
        f"Orders 1 to {highest:g} of the steady turn",
        rows,
        (
            (Head("cam"), lambda row: called.get(row[0], row[0])),
            (Head("speed", "rpm", ".6g"), lambda row: row[1].rpm),
            (Head("period", "turns", "d", "none"), _period),
            (Head("mean force", "N", ".2f"), lambda row: float(row[1].amplitude[0])),
            (Head("sound", "dB", ".1f"), lambda row: row[1].total_db),
            (Head("background", "dB", ".1f"), lambda row: row[1].background_db),
            *((Head(f"loudest {i + 1}"), _loudest(i)) for i in range(LOUDEST)),
        ),
        "Sound: of these orders together. Loudest: the order, and its level in dB re 20 µPa. The "
        "background has no orders.",
        "A landing's pulse sounds up to some kHz: more orders have more of it." if lands else "",
        "none: the force does not come back; it is the last turn run." if unsettled else "",
    )


def order_table(found: Iterable[CamOrders]) -> DataTable:
    """A row for each cam, speed and order, the mean at order 0 left out."""
    rows = [
        (cam, spectrum, i)
        for cam, spectrum in _spectra(found)
        for i in range(1, spectrum.orders.size)
    ]

    def of(name: str) -> Callable[[OrderRow], Cell]:
        return lambda row: float(getattr(row[1], name)[row[2]])

    return tabulate(
        "Force and sound by orders of the cam",
        rows,
        (
            (Head("cam"), lambda row: row[0]),
            (Head("speed", "rpm", ".6g"), lambda row: row[1].rpm),
            (Head("order", "", ".6g"), of("orders")),
            (Head("frequency", "Hz", ".2f"), of("frequency")),
            (Head("force amplitude", "N", ".4g"), of("amplitude")),
            (Head("force phase", "°", ".1f"), _phase),
            (Head("sound level", "dB", ".1f"), of("level")),
        ),
        "Phase: force = mean + Σ amplitude · cos(order · θ + phase). Level: dB re 20 µPa.",
    )


def to_json(found: Iterable[CamOrders]) -> dict[str, Any]:
    """All spectra as plain data."""
    return {
        study.cam: {
            "model": study.model,
            "rig": study.rig.name,
            "speeds": [_plain(spectrum) for spectrum in study.spectra],
        }
        for study in found
    }


def _plain(spectrum: OrderSpectrum) -> dict[str, Any]:
    return {
        "rpm": spectrum.rpm,
        "turns": spectrum.steady.turns,
        "settled": spectrum.steady.settled,
        "background_db": spectrum.background_db,
        "order": spectrum.orders.tolist(),
        "force_amplitude_N": spectrum.amplitude.tolist(),
        "force_phase_rad": np.angle(spectrum.force).tolist(),
        "sound_level_db": [None, *spectrum.level[1:].tolist()],
    }


def _spectra(found: Iterable[CamOrders]) -> Iterator[Row]:
    for study in found:
        for spectrum in study.spectra:
            yield study.cam, spectrum


def _period(row: Row) -> Cell:
    steady = row[1].steady
    return steady.turns if steady.settled else None


def _loudest(rank: int) -> Callable[[Row], Cell]:
    def words(row: Row) -> Cell:
        _, spectrum = row
        if spectrum.orders.size <= rank + 1:
            return None
        place = int(np.argsort(-spectrum.level[1:], kind="stable")[rank]) + 1
        return f"{spectrum.orders[place]:g}: {spectrum.level[place]:.1f}"

    return words


def _phase(row: OrderRow) -> Cell:
    return float(np.degrees(np.angle(row[1].force[row[2]])))


# The report's figures, drawn as SVG and carried in the page itself.

#: Highest order of the Campbell diagrams, whose rays stay apart on paper.
SHOWN_ORDERS = 40

#: Dots per inch of their thousands of strokes, which are pixels within the SVG.
ORDERS_DPI = 130
