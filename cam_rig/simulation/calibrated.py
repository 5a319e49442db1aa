"""Whether a rig's levels are sound pressure levels, or good for comparisons alone.

Gain and cut-off of the radiation take the error of everything before them: they hold for the
follower and the model that they were fitted with. A copy of the shipped rig with another mass and
spring has their numbers, but not their calibration. It is told by content, not by name.
"""

from __future__ import annotations

import math
from functools import lru_cache

from cam_rig.schema import RigConfig, load_rig
from cam_rig.schema.load import config_root
from cam_rig.schema.quantity import Quantity
from cam_rig.schema.rig import SI_UNITS

#: The shipped rig that was calibrated, and the model of the follower it was calibrated with.
SHIPPED, MODEL = "tm21", "one_mass"
#: What a level is worth whose rig was not calibrated, and what that means.
RELATIVE = "relative"
RELATIVE_NOTE = (
    "Relative: the rig's acoustic constants were not fitted with this follower and model, so only "
    "differences between levels mean something."
)
#: What follows in the source of a calibration: the follower and model it holds for.
FITTED_WITH = "; fitted with "
#: Two numbers that differ by less, relative, are the same in other units.
SAME = 1e-9


def is_calibrated(rig: RigConfig, model: str) -> bool:
    """Whether the acoustic constants of a rig were fitted with its own follower.

    They are identified, and not the shipped ones behind another follower or another model.

    Examples
    --------
    >>> import cam_rig
    >>> rig = cam_rig.load_rig("tm21")
    >>> is_calibrated(rig, "one_mass")
    True
    >>> is_calibrated(cam_rig.load_rig("paper_table2"), "two_mass")
    False
    """
    own, shipped = rig.radiation, _shipped()
    if own is None or not own.gain.origin == own.corner.origin == "identified":
        return False
    if not has_shipped_constants(rig):  # fitted anew
        said = own.gain.source.partition(FITTED_WITH)[2]
        return said in ("", fitted_with(rig, model))
    return model == MODEL and all(
        _same(getattr(rig.follower, key), getattr(shipped.follower, key))
        for key in type(rig.follower).model_fields
    )


def fitted_with(rig: RigConfig, model: str) -> str:
    """Model and follower in SI units, as ``cam-rig calibrate`` writes them into the source."""
    numbers = ((key, getattr(rig.follower, key)) for key in type(rig.follower).model_fields)
    said = (
        f"{key} {number.si:.9g} {SI_UNITS.get(key, '')}".strip()
        for key, number in numbers
        if number
    )
    return ", ".join((model, *said))


def has_shipped_constants(rig: RigConfig) -> bool:
    """Whether gain and cut-off are those that the shipped rig was calibrated to."""
    own, shipped = rig.radiation, _shipped().radiation
    if own is None or shipped is None:
        return False
    return _same(own.gain, shipped.gain) and _same(own.corner, shipped.corner)


def _same(one: Quantity | None, other: Quantity | None) -> bool:
    """Whether two numbers are one, whatever their units and origins; none is like none."""
    if one is None or other is None:
        return one is other
    return math.isclose(one.si, other.si, rel_tol=SAME)


@lru_cache(maxsize=1)
def _shipped() -> RigConfig:
    return load_rig(config_root() / "rigs" / f"{SHIPPED}.yaml")
