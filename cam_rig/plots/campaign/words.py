"""What inputs and measures are called on a figure's axes, and the units they are shown in."""

from __future__ import annotations

import re

from cam_rig.schema.quantity import UNITS
from cam_rig.schema.studies.campaign import PERCENT
from cam_rig.studies.campaign.inputs import CampaignInput
from cam_rig.studies.campaign.measures import CampaignMeasure

#: Parts of a path that say where a number stands and not what it is.
_PLACES = re.compile(r"^(?:(?:rig|cam)\.(?:follower\.)?|profile\.|scene\.(?:program\.)?)")
_UNITS = {"um": "µm", "deg": "°"}


def input_name(one: CampaignInput) -> str:
    """Such as ``spring stiffness``."""
    return _PLACES.sub("", one.path).replace(".", " ").replace("_", " ")


def input_unit(one: CampaignInput) -> tuple[str, float]:
    """The unit an input is shown in and one of it in SI; SI where the study has percents."""
    unit = one.si_unit if one.variation.unit == PERCENT else one.variation.unit
    return _UNITS.get(unit, unit), UNITS[one.dimension][unit]


def input_title(one: CampaignInput) -> str:
    """Name and unit."""
    unit = input_unit(one)[0]
    return input_name(one) if unit == "1" else f"{input_name(one)} [{unit}]"


def measure_unit(measure: CampaignMeasure) -> tuple[str, float]:
    """The unit a measure is shown in, and what one of it is in the unit of the rows."""
    quantity = measure.term.quantity
    unit = quantity.unit.replace("*", "·")
    return _UNITS.get(unit, unit), quantity.shown / measure.factor


def measure_title(measure: CampaignMeasure) -> str:
    """Words and unit."""
    unit = measure_unit(measure)[0]
    return f"{measure.term.words} [{unit}]" if unit else measure.term.words
