"""A rig file of what was identified; what nothing tells is another rig's, and assumed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from cam_rig.schema import RigConfig
from cam_rig.studies.cam_fit.cam_file import quantity, to_yaml
from cam_rig.studies.rig_fit.conclusions import gist
from cam_rig.studies.rig_fit.found import FoundNumber


def fitted_rig(
    name: str, numbers: Iterable[FoundNumber], base: RigConfig, source: str, residual: str
) -> tuple[str, tuple[str, ...]]:
    """The file's text, and what it assumes, a sentence each.

    Parameters
    ----------
    base : rig whose numbers stand where nothing else is known
    source, residual : of what was identified, for the file
    """
    data: dict[str, Any] = {"name": name, "title": f"{name}: identified from {source}"}
    borrowed, follower = f"the rig {base.name}'s, not identified by {source}", dict[str, Any]()
    found = {number.name: number for number in numbers}
    dumped = base.model_dump(exclude_none=True)
    two_masses = "roller_share" in found
    for key, value in dumped["follower"].items():
        if key in ("roller_share", "stem_damping") and not two_masses:
            continue
        number = found.pop(key, None)
        if number is None or number.value is None:
            raw = getattr(base.follower, key).raw
            follower[key] = quantity("assumed", raw, value["unit"], borrowed)
        else:
            follower[key] = _quantity(number, source, residual)
    for key, number in found.items():
        if number.value is not None:
            follower[key] = _quantity(number, source, residual)
    data["follower"] = follower
    if base.radiation is not None:
        data["radiation"] = {
            key: quantity("assumed", getattr(base.radiation, key).raw, value["unit"], borrowed)
            for key, value in dumped["radiation"].items()
            if isinstance(value, dict)
        }
    missing = [key for key, value in follower.items() if "assumed" in value]
    assumed = [f"{', '.join(missing)}: the rig {base.name}'s"] if missing else []
    if base.radiation is not None:
        assumed.append(f"sound: the rig {base.name}'s, levels are relative")
    return to_yaml(data), tuple(assumed)


def _quantity(number: FoundNumber, source: str, residual: str) -> dict[str, Any]:
    assert number.value is not None
    if number.origin == "given":
        return quantity("given", number.value, number.unit, "given to the fit")
    value = float(number.shown)
    return quantity("identified", value, number.unit, source, f"{gist(number)}; {residual}")
