"""Rig file of a fit: identified parameters, completed by the values of another rig."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from cam_rig.errors import ConfigError
from cam_rig.files import write_new
from cam_rig.schema import RigConfig
from cam_rig.schema.load import assumed_numbers, quantity_data, to_yaml
from cam_rig.studies.fit_rig.estimate import ParameterEstimate
from cam_rig.studies.fit_rig.jumps.fit import JumpFit
from cam_rig.studies.fit_rig.parameters import TWO_MASS_ONLY
from cam_rig.studies.fit_rig.run.result import RigFit


def build_rig_text(
    name: str, numbers: Iterable[ParameterEstimate], base: RigConfig, source: str, residual: str
) -> tuple[str, tuple[str, ...]]:
    """Return the text of a rig file with the identified parameters.

    Parameters without a value are copied from the rig ``base`` and marked as assumed. The second
    result has one sentence for each group of copied values. ``source`` (the command) and
    ``residual`` are texts that document the origin of the identified values.
    """
    data: dict[str, Any] = {"name": name, "title": f"{name}: identified from {source}"}
    assumption = f"the rig {base.name}'s, not identified by {source}"
    estimates = {estimate.name: estimate for estimate in numbers}
    follower = assumed_numbers(base.follower, assumption)
    if "roller_share" not in estimates:
        follower = {key: entry for key, entry in follower.items() if key not in TWO_MASS_ONLY}
    for key, estimate in estimates.items():
        if estimate.value is None:
            continue
        if estimate.origin == "given":
            text = "given to the fit"
            follower[key] = quantity_data("given", estimate.value, estimate.unit, text)
        else:
            value, text = float(estimate.value_text), f"{estimate.text}; {residual}"
            follower[key] = quantity_data("identified", value, estimate.unit, source, text)
    data["follower"] = follower
    if base.radiation is not None:
        data["radiation"] = assumed_numbers(base.radiation, assumption)
    missing = [key for key, value in follower.items() if "assumed" in value]
    assumed = [f"{', '.join(missing)}: the rig {base.name}'s"] if missing else []
    if base.radiation is not None:
        assumed.append(f"sound: the rig {base.name}'s, levels are relative")
    return to_yaml(data), tuple(assumed)


def write_rig(out: Path, fit: JumpFit | RigFit, base: RigConfig, source: Path) -> RigFit | JumpFit:
    """Write the rig file of a fit, and return the fit with a list of assumptions.

    The field ``assumed`` of the result lists, as sentences, the values that were copied from the
    rig ``base``. ``source`` is the file of the measurement.
    """
    if not any(estimate.value is not None for estimate in fit.numbers):
        raise ConfigError(f"--out {out}: the fit identified no parameter, so no rig was written")
    command = f"cam-rig fit rig {source.name}"
    text, assumed = build_rig_text(out.stem, fit.numbers, base, command, fit.residual_text)
    write_new(out.parent, {out.name: text})
    return replace(fit, assumed=assumed)
