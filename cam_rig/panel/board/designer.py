"""A process of its own for one design, so that the board goes on answering meanwhile.

It reads cam, rig and name as one line of JSON, writes each better jump speed as a line, and in the
end the designed cam's file with its motion, or why there is none.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from typing import Any

from cam_rig.errors import CamRigError
from cam_rig.law_design.design import search_design as design
from cam_rig.law_design.request import DesignRequest
from cam_rig.panel.board.drawn_law import motion_in_base64
from cam_rig.panel.board.files import GOAL, LIMIT
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.units import RPM


def designed(
    cam: CamConfig, rig: RigConfig, name: str, told: Callable[[float], None]
) -> dict[str, Any]:
    """The law that `cam-rig design` finds from a cam for the board's goal, as a page takes it.

    ``told`` is called with each better jump speed, rpm.
    """
    request = DesignRequest.of(maximise=GOAL, limits=[LIMIT])
    found = design(cam, rig, request, name, lambda _, value: told(value / RPM))
    rpm = found.measures[0].result / RPM
    return {"rpm": rpm, "motion": motion_in_base64(found.law), "text": found.text}


def main() -> None:
    """One design of what standard input says."""
    first = json.loads(sys.stdin.readline())
    cam, rig = CamConfig.model_validate(first["cam"]), RigConfig.model_validate(first["rig"])

    def told(rpm: float) -> None:
        print(json.dumps({"so_far_rpm": rpm}), flush=True)

    try:
        found = designed(cam, rig, first["name"], told)
    except CamRigError as error:
        found = {"words": str(error)}
    print(json.dumps(found), flush=True)


if __name__ == "__main__":
    main()
