"""Write config/params: a parameter file for each node, with every default.

    .venv/bin/python tools/docs/parameters.py

``make docs`` runs it first, and a test compares the files with the table of parameters.
"""

from __future__ import annotations

import json
from pathlib import Path

from cam_rig.nodes.parameters import PARAMETERS, Spec

FOLDER = Path(__file__).parents[2] / "config" / "params"


def text(node: str) -> str:
    """Return the parameter file of a node, valid in any namespace."""
    lines = [
        f"# The parameters of {node} with their defaults; {node} --help tells what is allowed.",
        f"#   ros2 run cam_rig {node} --ros-args --params-file config/params/{node}.yaml",
        f"/**/{node}:",
        "  ros__parameters:",
    ]
    for spec in PARAMETERS[node]:
        lines += _lines(spec)
    return "\n".join(lines) + "\n"


def _lines(spec: Spec) -> list[str]:
    # JSON is valid YAML, and quotes texts.
    return [f"    # {spec.description}", f"    {spec.name}: {json.dumps(spec.default)}"]


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name in PARAMETERS:
        (FOLDER / f"{name}.yaml").write_text(text(name), encoding="utf-8")
