"""Worker process for results that take too long to compute in the panel server.

It reads lines of JSON from standard input and writes lines of JSON. With the argument ``design`` it
makes one design. Otherwise it returns the slow results of each law (`evaluation.evaluate_full`)
until its input ends. It therefore ends with the server, however the server ends.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np

from cam_rig.errors import CamRigError
from cam_rig.laws import Law
from cam_rig.panel.board.drawable import with_base_radius
from cam_rig.panel.board.evaluation import evaluate_full
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.yaml_text import parse_yaml
from cam_rig.units import RPM


def _send(message: dict[str, Any]) -> None:
    print(json.dumps(message), flush=True)


def answer_laws(_: dict[str, Any], cam: CamConfig, rig: RigConfig) -> None:
    """Read laws from standard input, and write the results of each as one line.

    They are the slow results, those of `evaluation.evaluate_full`. Each request has a base radius.
    """
    for line in sys.stdin:
        request = json.loads(line)
        law = Law(cam.name, np.array(request["breaks"]), np.array(request["ordinates"]))
        changed = with_base_radius(cam, request["base_radius_mm"], cam.name)
        _send(evaluate_full(changed, law, rig, request["rpm"]))


def design(first: dict[str, Any], cam: CamConfig, rig: RigConfig) -> None:
    """Optimise a cam law, and write the progress and the result to standard output.

    A line is written for each better jump speed, then one line with the law or with an error.
    """
    from cam_rig.panel.board.board import GOAL, LIMIT, law_for_comparison
    from cam_rig.studies.design.request import DesignRequest
    from cam_rig.studies.design.study import search_design

    def report(_: object, value: float) -> None:
        _send({"best_rpm": value / RPM})

    try:
        request = DesignRequest.of(maximise=GOAL, limits=[LIMIT])
        result = search_design(cam, rig, request, first["name"], report)
    except CamRigError as error:
        _send({"message": str(error)})
    else:
        rpm = result.measures[0].result / RPM
        designed = CamConfig.model_validate(parse_yaml(result.text))
        law = law_for_comparison(designed, result.law)
        _send({"rpm": rpm, "law": law, "text": result.text})


def main() -> None:
    """Execute the request in the first line of standard input."""
    first = json.loads(sys.stdin.readline())
    cam, rig = CamConfig.model_validate(first["cam"]), RigConfig.model_validate(first["rig"])
    (design if sys.argv[1:] == ["design"] else answer_laws)(first, cam, rig)


if __name__ == "__main__":
    main()
