"""Orders of force and sound as a result: speed by speed, and order by order."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from cam_rig.paper.orders.spectrum import CamOrders, OrderSpectrum
from cam_rig.show.result import Column, Footnote, Records, Result

#: So many of the loudest orders are named.
LOUDEST = 2
#: Orders are shown up to so many rows.
SHOWN = 40


@dataclass(frozen=True)
class OrdersRow:
    """One of a cam's spectra."""

    cam: str
    spectrum: OrderSpectrum

    def loudest(self, rank: int) -> tuple[float, float] | None:
        """The loudest order, the second, …, with its level (dB)."""
        orders, level = self.spectrum.orders[1:], self.spectrum.level[1:]
        if level.size <= rank:
            return None
        place = np.argsort(-level, kind="stable")[rank]
        return float(orders[place]), float(level[place])


@dataclass(frozen=True)
class OrderRow:
    """An order of a cam at a speed: its place in the spectrum."""

    cam: str
    spectrum: OrderSpectrum
    place: int


def _of(name: str) -> Callable[[OrderRow], float]:
    return lambda row: float(getattr(row.spectrum, name)[row.place])


def _loudest(rank: int) -> Column:
    def order(row: OrdersRow) -> float | None:
        found = row.loudest(rank)
        return found and found[0]

    def words(row: OrdersRow) -> str | None:
        found = row.loudest(rank)
        return found and f"{found[0]:g}: {found[1]:.1f}"

    return Column(f"loudest_{rank + 1}", of=order, cell=words)


@dataclass(frozen=True, repr=False)
class OrdersResult(Result):
    """The orders of each cam at each speed; what cams are called, where not by name."""

    schema = "cam_rig.orders.1"
    drawn_by = "cam_rig.paper.orders.figures:figure"
    columns: ClassVar = {
        "orders": (
            Column("cam"),
            Column("rpm", "rpm", ".6g", "speed", "spectrum.rpm"),
            Column("order", "", ".6g", of=_of("orders")),
            Column("frequency", "Hz", ".2f", of=_of("frequency")),
            Column("force_amplitude", "N", ".4g", of=_of("amplitude")),
            Column(
                "force_phase",
                "°",
                ".1f",
                of=lambda row: float(np.angle(row.spectrum.force[row.place])),
            ),
            Column("level", "dB", ".1f", "sound level", _of("level")),
        ),
        "speeds": (
            Column("cam"),
            Column("rpm", "rpm", ".6g", "speed", "spectrum.rpm"),
            Column(
                "period",
                "",
                "d",
                "period, turns",
                "spectrum.steady.turns",
                lambda row: row.spectrum.steady.turns if row.spectrum.steady.settled else None,
                missing="none",
            ),
            Column("mean_force", "N", ".2f", of="spectrum.amplitude.0"),
            Column("level", "dB", ".1f", "sound", "spectrum.total_db"),
            Column("background_level", "dB", ".1f", "background", "spectrum.background_db"),
            *map(_loudest, range(LOUDEST)),
            Column("settled", of="spectrum.steady.settled", hidden=True),
        ),
        "run": (Column("rig", of="rig.name"), Column("model")),
    }

    studies: tuple[CamOrders, ...]
    titles: Mapping[str, str] = field(default_factory=dict)

    @property
    def speed_rows(self) -> list[OrdersRow]:
        """A row for each cam and speed."""
        return [OrdersRow(study.cam, one) for study in self.studies for one in study.spectra]

    @property
    def speeds(self) -> Records:
        """A row for each cam and speed: mean force, sound of all orders, the loudest of them."""
        rows = self.speed_rows
        highest = max((row.spectrum.orders[-1] for row in rows), default=0.0)
        return self.table(
            "speeds",
            f"Orders 1 to {highest:g} of the steady turn",
            rows,
            "Sound: of these orders together. Loudest: the order, and its level in dB re 20 µPa. "
            "The background has no orders.",
            Footnote(
                "A landing's pulse sounds up to some kHz: more orders have more of it.",
                lambda row: row.spectrum.steady.landings,
            ),
            Footnote(
                "none: the force does not come back; it is the last turn run.",
                lambda row: not row.spectrum.steady.settled,
            ),
        )

    def tables(self) -> list[Records]:
        """``orders``, the mean at order 0 left out, ``speeds`` and ``run``."""
        rows = [
            OrderRow(row.cam, row.spectrum, place)
            for row in self.speed_rows
            for place in range(1, row.spectrum.orders.size)
        ]
        orders = self.table(
            "orders",
            "Force and sound by orders of the cam",
            rows,
            "Phase: force = mean + Σ amplitude · cos(order · θ + phase). Level: dB re 20 µPa.",
            hidden=len(rows) > SHOWN,
        )
        run: list[Any] = list(self.studies[:1])
        return [orders, self.speeds, self.table("run", "The model", run, single=True, hidden=True)]
