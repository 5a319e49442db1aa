"""Tuning of a rise to the stem of a rig at one speed, and input shaping."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ValidationInfo

from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.schema.rig import Damping, Mass, RigConfig, Stiffness
from cam_rig.schema.segment_base import OtherFile


class StemOnRig(OtherFile):
    """Numbers of a rig's follower on its stem, and the name of the rig."""

    name: str
    mass: Mass
    spring_stiffness: Stiffness
    stem_stiffness: Stiffness
    damping: Damping


def _read_rig(value: Any, info: ValidationInfo) -> Any:
    """Return the numbers of a rig that a file names, or of a rig in Python.

    A mapping is returned unchanged, because a copied config contains the numbers.
    """
    from cam_rig.schema.load import Library, config_root, load_rig

    if isinstance(value, str):
        folder = (info.context or {}).get("folder")
        roots = [config_root()] if folder is None else [Path(folder).parent, config_root()]
        value = load_rig(Library(tuple(roots)).path("rigs", value))
    if isinstance(value, dict | StemOnRig):
        return value
    if not isinstance(value, RigConfig):
        raise ValueError(f"is {value!r:.40}; allowed: the name of a rig")
    if value.follower.stem_stiffness is None:
        raise ValueError(f"is {value.name!r} without stem_stiffness; allowed: a rig with a stem")
    keys = StemOnRig.model_fields.keys() - {"name"}
    return {"name": value.name, **{key: getattr(value.follower, key) for key in keys}}


class Tuning(Strict):
    """Speed and rig to which a rise is tuned.

    Parameters
    ----------
    speed : Quantity
        Speed of the cam, rad/s.
    rig : StemOnRig
        Follower on its stem. A file contains the name of the rig.
    """

    speed: Annotated[Quantity, must_be("speed", gt=0.0, le=1e6)]
    rig: Annotated[StemOnRig, BeforeValidator(_read_rig)]


class Shaping(Tuning):
    """Input shaping of a rise: its sum with copies that are delayed by half periods.

    `kind` is ZV (one copy) or ZVD (two copies, also without vibration near the speed).
    """

    kind: Literal["ZV", "ZVD"]
