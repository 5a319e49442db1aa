"""Orders over speed: the spectra of cams at many speeds, one beside the other."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.studies.orders.spectrum import OrderSpectrum, order_spectrum

#: Highest order by default: 667 Hz at 400 rpm.
HIGHEST = 100


@dataclass(frozen=True, eq=False)
class CamOrders:
    """The spectra of one cam, speed by speed."""

    cam: str
    model: str
    rig: RigConfig
    spectra: tuple[OrderSpectrum, ...]


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
