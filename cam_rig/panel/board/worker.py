"""A process beside the server for what takes longer than a page may wait.

It reads lines of JSON and writes such lines. Asked to ``design`` it makes one design; else it says
of each law what it comes to at rest (`drawable.at_rest`), until its input ends: however the server
ends, it is not left behind.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np

from cam_rig.errors import CamRigError
from cam_rig.laws import Law
from cam_rig.panel.board.drawable import at_rest, file_jump
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.units import RPM


def _say(message: dict[str, Any]) -> None:
    print(json.dumps(message), flush=True)


def answer_laws(first: dict[str, Any], cam: CamConfig, rig: RigConfig) -> None:
    """Laws on a cam, a line each; with the jump speed of the ``file`` they stand for, if any."""
    own = {}
    if first["file"] is not None:
        own = {"file_jump": file_jump(CamConfig.model_validate(first["file"]), rig)}
    for line in sys.stdin:
        asked = json.loads(line)
        law = Law(cam.name, np.array(asked["breaks"]), np.array(asked["ordinates"]))
        _say(at_rest(cam, law, rig, asked["rpm"]) | own)


def design(first: dict[str, Any], cam: CamConfig, rig: RigConfig) -> None:
    """Each better jump speed that `cam-rig design` finds, then its law, or why there is none."""
    from cam_rig.panel.board.board import GOAL, LIMIT
    from cam_rig.panel.board.drawn_law import motion_in_base64
    from cam_rig.studies.design.request import DesignRequest
    from cam_rig.studies.design.study import search_design

    def told(_: object, value: float) -> None:
        _say({"so_far_rpm": value / RPM})

    try:
        request = DesignRequest.of(maximise=GOAL, limits=[LIMIT])
        found = search_design(cam, rig, request, first["name"], told)
    except CamRigError as error:
        _say({"words": str(error)})
    else:
        rpm = found.measures[0].result / RPM
        _say({"rpm": rpm, "motion": motion_in_base64(found.law), "text": found.text})


def main() -> None:
    """Do what the first line of standard input is about."""
    first = json.loads(sys.stdin.readline())
    cam, rig = CamConfig.model_validate(first["cam"]), RigConfig.model_validate(first["rig"])
    (design if sys.argv[1:] == ["design"] else answer_laws)(first, cam, rig)


if __name__ == "__main__":
    main()
