"""The question the paper leaves open: Bézier 15's continuity, or its lower acceleration.

Two full tables of laws against angles. In the first every law has the same event angles, so that
smoother laws are also sharper: continuity costs acceleration. In the second every law has the
angle at which all accelerate alike, so that continuity stands alone. Then the proposed cam itself:
what of its advantage remains with a rigid follower, and what when its event is compressed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws import Law
from cam_rig.laws.catalogue import figures
from cam_rig.schema import FactorialConfig
from cam_rig.studies.factorial.anova import TwoWay, two_way
from cam_rig.studies.factorial.laws import as_gentle, squeezed, up_and_down
from cam_rig.studies.factorial.measures import Bench, Measures

#: A map that may work in several processes: (function, items) -> results in order.
Each = Callable[[Callable[[Law], Measures], Iterable[Law]], Iterable[Measures]]
#: Fewer laws have no variance to analyse.
MIN_LAWS = 2


@dataclass(frozen=True)
class Effect:
    """An effect that is analysed: its key in `Measures`, name, unit, and factor to that unit.

    ``decibels`` of amplitude: effects multiply, so logarithms of them add. ``speeds`` is the key
    of the study's speeds at which a follower in contact is supposed; empty where it may leave.
    """

    key: str
    name: str
    unit: str
    factor: float = 1.0
    decibels: bool = True
    speeds: str = ""

    def values(self, cells: list[list[Measures]]) -> FloatArray:
        """The table in the unit, ``(a, b)``."""
        return self.factor * np.array([[getattr(m, self.key) for m in row] for row in cells])

    def analysed(self, cells: list[list[Measures]]) -> FloatArray:
        """What is analysed: dB, for amplitudes 20 lg."""
        values = self.values(cells)
        return 20.0 * np.log10(values) if self.decibels else values


EFFECTS = (
    Effect("jump", "jump speed", "rpm", 30.0 / math.pi),
    Effect("acceleration", "peak acceleration", "m/s²", speeds="accelerated"),
    Effect("residual", "residual vibration", "µm", 1e6, speeds="residual"),
    Effect("noise", "noise, rigid follower", "dB", decibels=False),
    Effect("noise_in_contact", "noise, elastic", "dB", decibels=False, speeds="noise_in_contact"),
)


@dataclass(frozen=True, eq=False)
class Design:
    """A table of laws (rows) against angles (columns, rad), and its analysis by effect."""

    name: str
    rises: tuple[str, ...]
    angles: FloatArray
    cells: list[list[Measures]]

    @property
    def classes(self) -> list[int]:
        """C^k of each law against its dwells."""
        return [figures(rise).continuity for rise in self.rises]

    def analysis(self, effect: Effect) -> TwoWay:
        """The analysis of variance of one effect."""
        return two_way(effect.analysed(self.cells), self.classes)

    def from_class(self, least: int) -> Design | None:
        """The same with the laws of class C^least and above alone; None for fewer than two."""
        keep = [i for i, order in enumerate(self.classes) if order >= least]
        if len(keep) < MIN_LAWS:
            return None
        rises = tuple(self.rises[i] for i in keep)
        name = f"{self.name}, C{least} and above"
        return Design(name, rises, self.angles, [self.cells[i] for i in keep])


@dataclass(frozen=True, eq=False)
class Factorial:
    """Both designs; the proposed cam and those it is compared with; the proposed cam squeezed."""

    config: FactorialConfig
    same_angles: Design
    same_acceleration: Design
    cams: dict[str, Measures]
    squeezed: dict[float, Measures]

    @property
    def designs(self) -> list[Design]:
        """Both designs, each followed by its laws of C2 and above where only some are."""
        found = []
        for design in (self.same_angles, self.same_acceleration):
            smooth = design.from_class(2)
            found += (
                [design] if smooth is None or smooth.rises == design.rises else [design, smooth]
            )
        return found


def run_factorial(
    config: FactorialConfig, bench: Bench, cams: dict[str, Law], each: Each = map
) -> Factorial:
    """Measure every cell.

    Parameters
    ----------
    cams : the proposed cam and others to compare it with, as they are
    each : a map over laws, perhaps in several processes

    Raises
    ------
    DynamicsError : a cell without a jump speed or without a steady state
    """
    lift, rises = config.lift.si, tuple(config.rises)
    same = [[up_and_down(rise, event, lift) for event in config.events.si_list] for rise in rises]
    gentle = [
        [
            up_and_down(rise, as_gentle(rise, config.reference, event), lift)
            for event in config.gentle.si_list
        ]
        for rise in rises
    ]
    pressed = [squeezed(cams[config.proposed], span) for span in config.squeezed.si_list]
    laws = [law for row in (*same, *gentle) for law in row]
    found = list(each(bench.measure, [*laws, *cams.values(), *pressed]))
    rows = _Rows(found)
    return Factorial(
        config=config,
        same_angles=Design("same angles", rises, np.array(config.events.si_list), rows.table(same)),
        same_acceleration=Design(
            "same acceleration", rises, np.array(config.gentle.si_list), rows.table(gentle)
        ),
        cams=dict(zip(cams, rows.take(len(cams)), strict=True)),
        squeezed=dict(zip(config.squeezed.si_list, rows.take(len(pressed)), strict=True)),
    )


class _Rows:
    """Hands results out in the order of the laws."""

    def __init__(self, found: list[Measures]) -> None:
        self._left = iter(found)

    def take(self, count: int) -> list[Measures]:
        return [next(self._left) for _ in range(count)]

    def table(self, laws: list[list[Law]]) -> list[list[Measures]]:
        return [self.take(len(row)) for row in laws]
