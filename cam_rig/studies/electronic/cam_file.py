"""Cam file of a controller's cam: each piece of its law as a Bézier segment."""

from __future__ import annotations

import math

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.files import MIB
from cam_rig.laws.law import Law
from cam_rig.schema import CamConfig
from cam_rig.schema.load import MAX_BYTES, quantity_data, to_yaml, validate_cam
from cam_rig.studies.electronic.controller import MM

#: Base radius and roller radius in lifts, a usual proportion. A controller's text has neither.
RADII_IN_LIFTS = {"base_radius": 3.0, "roller_radius": 0.6}
#: Source of the radii in the file.
FREE_CHOICE = "a free choice, not in the controller's text: replace it"


def controller_cam_file(law: Law, name: str, source: str) -> tuple[CamConfig, str]:
    """Return a cam with the law of a controller, and the text of its file.

    Parameters
    ----------
    law : Law
        Law that the controller executes.
    name : str
        Name of the cam and of its file.
    source : str
        Source of the numbers, such as the name of the controller's text.

    Raises
    ------
    ConfigError
        If the slave does not move, the file would be too large, or the name is not allowed.
    """
    if not law.lift > 0.0:
        raise ConfigError(f"{source}: the slave does not move; allowed: a cam with a lift")
    lift_mm = law.lift / MM
    radii = {
        key: quantity_data("assumed", float(f"{lifts * lift_mm:.6g}"), "mm", FREE_CHOICE)
        for key, lifts in RADII_IN_LIFTS.items()
    }
    segments = []
    for span, column in zip(law.spans, law.ordinates.T, strict=True):
        is_flat = bool(np.all(column == column[0]))
        ordinates = (column[:2] if is_flat else column) / law.lift
        segments.append(
            {
                "law": "bezier",
                "span": quantity_data("given", math.degrees(span), "deg", source),
                "ordinates": quantity_data("given", ordinates.tolist(), "1", source),
            }
        )
    data = {
        "name": name,
        "title": f"{name}, as the controller moves it",
        "lift": quantity_data("given", lift_mm, "mm", source),
        "follower": {"type": "roller", **radii},
        "segments": segments,
    }
    text = f"# Made by cam-rig electronic from {source}.\n" + to_yaml(data)
    if len(text.encode()) > MAX_BYTES:
        raise ConfigError(
            f"{source}: its {law.spans.size} pieces need a cam file of {len(text) / MIB:.3g} MiB; "
            f"allowed: {MAX_BYTES / MIB:g} MiB, so read fewer points"
        )
    return validate_cam(data), text
