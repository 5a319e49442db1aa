"""The states of the cam and the sound pressures of a recording of the rig."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from cam_rig.bag.reader import messages
from cam_rig.errors import BagError, RefusedError
from cam_rig.messages import topics
from cam_rig.messages.codec import cam_state_of, stamp_ns
from cam_rig.simulation.schedule import CamState


def read_states(bag: Path, namespace: str | None = None) -> Iterator[CamState]:
    """The states of the cam in the order of the bag.

    Raises
    ------
    BagError : no such bag, one that was not closed, or a state that is none
    """
    try:
        for _, _, message in messages(bag, (topics.CAM_STATE,), namespace):
            yield cam_state_of(message)
    except RefusedError as error:
        raise BagError(f"{bag}: {error}") from None


def read_pressures(bag: Path, namespace: str | None = None) -> dict[int, float]:
    """r.m.s. sound pressure (Pa) of each tick by the stamp (ns) of its end.

    Raises
    ------
    BagError : no such bag, one that was not closed, or a stamp that is none
    """
    try:
        return {
            stamp_ns(message.header.stamp): float(message.fluid_pressure)
            for _, _, message in messages(bag, (topics.PRESSURE,), namespace)
        }
    except RefusedError as error:
        raise BagError(f"{bag}: {error}") from None
