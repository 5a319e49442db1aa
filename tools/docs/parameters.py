"""Write config/params, a parameter file for each node, and config/record_qos.yaml.

The second file contains the QoS of each topic, for ``ros2 bag record`` and ``ros2 bag play``.

    .venv/bin/python tools/docs/parameters.py

``make docs`` runs it first, and a test compares the files with the table of parameters.
"""

from __future__ import annotations

import json
from pathlib import Path

from cam_rig.messages.topics import TOPICS
from cam_rig.nodes.parameters import PARAMETERS, Spec
from cam_rig.nodes.recorder import MAX_NODES

FOLDER = Path(__file__).parents[2] / "config" / "params"
QOS_FILE = FOLDER.with_name("record_qos.yaml")


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


def qos_text() -> str:
    """Return the QoS override file of rosbag2 for the topics of a rig in the root namespace."""
    lines = [
        "# QoS of each topic, for rosbag2:",
        "#   ros2 bag record --all-topics --qos-profile-overrides-path config/record_qos.yaml",
    ]
    for topic in TOPICS:
        # a late recorder receives the history of each publisher of a topic without an owner
        publishers = 1 if topic.owner or not topic.latched else MAX_NODES
        durability = "transient_local" if topic.latched else "volatile"
        lines += [
            f"{topic.name}:",
            "  reliability: reliable",
            f"  durability: {durability}",
            "  history: keep_last",
            f"  depth: {topic.depth * publishers}",
        ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    QOS_FILE.write_text(qos_text(), encoding="utf-8")
    FOLDER.mkdir(exist_ok=True)
    for name in PARAMETERS:
        (FOLDER / f"{name}.yaml").write_text(text(name), encoding="utf-8")
