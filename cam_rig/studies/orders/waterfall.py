"""Orders over speed: the spectra of cams at many speeds, one beside the other."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.studies.orders.spectrum import OrderSpectrum, order_spectrum

#: What is shown over speed: the spectra's property, and its heading.
QUANTITIES = {"force_db": "contact force [dB re 1 N]", "level": "sound [dB re 20 µPa]"}
#: dB between what is shown brightest and what is not shown.
RANGE = 60.0
#: Highest order by default: 667 Hz at 400 rpm.
HIGHEST = 100


@dataclass(frozen=True, eq=False)
class CamOrders:
    """The spectra of one cam, speed by speed."""

    cam: str
    model: str
    rig: RigConfig
    spectra: tuple[OrderSpectrum, ...]

    def at(self, rpm: float) -> OrderSpectrum:
        """The spectrum of the speed that is nearest to one in rpm."""
        return min(self.spectra, key=lambda spectrum: abs(spectrum.rpm - rpm))

    def only(self, *rpms: float) -> CamOrders:
        """The same at the speeds that are nearest to these."""
        return replace(self, spectra=tuple(self.at(rpm) for rpm in rpms))

    def up_to(self, highest: float) -> CamOrders:
        """The same without the orders above one."""
        return replace(self, spectra=tuple(found.up_to(highest) for found in self.spectra))

    @property
    def edges(self) -> FloatArray:
        """``(n + 1,)`` rpm between the speeds, and as far beyond the first and the last."""
        rpm = np.array([spectrum.rpm for spectrum in self.spectra])
        if rpm.size == 1:
            return np.array([0.995 * rpm[0], 1.005 * rpm[0]])
        ends = 1.5 * rpm[[0, -1]] - 0.5 * rpm[[1, -2]]
        return np.concatenate((ends[:1], 0.5 * (rpm[1:] + rpm[:-1]), ends[1:]))

    def strokes(self) -> FloatArray:
        """``(k, 2, 2)`` (rpm, Hz) of a stroke for each order but 0 at each speed, on its ray."""
        found = []
        for spectrum, ends in zip(self.spectra, pairwise(self.edges), strict=True):
            per_rpm = spectrum.orders[1:] / 60.0
            both = [np.column_stack([np.full_like(per_rpm, x), per_rpm * x]) for x in ends]
            found.append(np.stack(both, axis=1))
        return np.concatenate(found)

    def values(self, quantity: str) -> FloatArray:
        """``(k,)`` dB of each stroke: of "force_db" or "level"."""
        return np.concatenate([getattr(spectrum, quantity)[1:] for spectrum in self.spectra])


def loudest(found: Iterable[CamOrders], quantity: str) -> float:
    """The largest of all cams, dB: all are shown on one scale."""
    return max(float(study.values(quantity).max()) for study in found)


def waterfall(
    laws: dict[str, Law],
    model: str,
    rig: RigConfig,
    speeds: Iterable[float],
    highest: int = HIGHEST,
    on_speed: Callable[[], None] = lambda: None,
) -> tuple[CamOrders, ...]:
    """Force and sound of each cam at each of ``speeds`` (rad/s), up to an order.

    Raises
    ------
    ConfigError : the model's force is no closed form, or the rig lacks a number that it needs
    DynamicsError : a law is not for the model, or a mode without damping is in resonance
    """
    found, all_speeds = [], tuple(speeds)
    for cam, law in laws.items():
        spectra = []
        for speed in all_speeds:
            spectra.append(order_spectrum(law, model, rig, speed, highest))
            on_speed()
        found.append(CamOrders(cam, model, rig, tuple(spectra)))
    return tuple(found)
