"""Tests of the layouts in config/layouts against the golden bag.

A layout is a file of settings for RViz, Foxglove or PlotJuggler. It may only use topics, fields,
frames and message types of the bag.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from ruamel.yaml import YAML

ROOT = Path(__file__).parents[1]
LAYOUTS = sorted((ROOT / "config" / "layouts").iterdir())
MARKERS, WRENCH = "visualization_msgs/msg/MarkerArray", "geometry_msgs/msg/WrenchStamped"
#: Message type that each type of display in RViz shows, or None.
DISPLAYS = {
    "rviz_default_plugins/MarkerArray": MARKERS,
    "rviz_default_plugins/RobotModel": "std_msgs/msg/String",
    "rviz_default_plugins/TF": None,
    "rviz_default_plugins/Wrench": WRENCH,
}


class Use(NamedTuple):
    """Topic that a layout displays, with the displayed field and the message type."""

    topic: str
    field: str = ""
    type: str | None = None


@pytest.fixture(scope="module")
def golden() -> SimpleNamespace:
    """Golden bag (reference recording): message types, last messages and frames."""
    with AnyReader([ROOT / "bags" / "golden"]) as reader:
        types = {topic: info.msgtype for topic, info in reader.topics.items()}
        found = {
            connection.topic: reader.deserialize(raw, connection.msgtype)
            for connection, _, raw in reader.messages()
        }
    frames = {
        name
        for topic in ("/tf", "/tf_static")
        for one in found[topic].transforms
        for name in (one.header.frame_id, one.child_frame_id)
    }
    return SimpleNamespace(types=types, messages=found, frames=frames)


def rviz(path: Path) -> tuple[list[Use], set[str]]:
    """Return the topics of the displays in an RViz file, and the fixed frame."""
    manager = YAML(typ="safe").load(path.read_text(encoding="utf-8"))["Visualization Manager"]
    uses = []
    for display in manager["Displays"]:
        topic = display.get("Topic") or display.get("Description Topic")
        if topic is not None:
            uses.append(Use(topic["Value"], "", DISPLAYS[display["Class"]]))
        else:
            assert DISPLAYS[display["Class"]] is None, display["Class"]
    return uses, {manager["Global Options"]["Fixed Frame"]}


def foxglove(path: Path) -> tuple[list[Use], set[str]]:
    """Return topics and fields of the panels in a Foxglove file, and the fixed frame."""
    layout = json.loads(path.read_text(encoding="utf-8"))
    panels, uses, frames = layout["configById"], list[Use](), set[str]()
    assert sorted(leaves(layout["layout"])) == sorted(panels), "panels that are not shown"
    for name, panel in panels.items():
        kind = name.partition("!")[0]
        if kind == "Plot":
            for each in panel["paths"]:
                topic, _, field = each["value"].partition(".")
                uses.append(Use(topic, field))
        elif kind == "3D":
            uses += [Use(topic, "", MARKERS) for topic in panel["topics"]]
            layers = panel["layers"].values()
            assert {layer["layerId"] for layer in layers} == {"foxglove.Urdf"}
            uses += [Use(layer["topic"], "", "std_msgs/msg/String") for layer in layers]
            frames.add(panel["followTf"])
        else:
            assert kind == "DiagnosticSummary", kind
            uses.append(Use(panel["topicToRender"], "", "diagnostic_msgs/msg/DiagnosticArray"))
    return uses, frames


def leaves(node: Any) -> Iterator[str]:
    """Yield the panels in the tree of a Foxglove layout."""
    if isinstance(node, str):
        yield node
    else:
        assert node["direction"] in ("row", "column")
        assert 0 < node["splitPercentage"] < 100
        yield from leaves(node["first"])
        yield from leaves(node["second"])


def plotjuggler(path: Path) -> tuple[list[Use], set[str]]:
    """Return the curves of a PlotJuggler file, and an empty set of frames.

    A curve is a topic and a field with slashes. For a joint, the name of the joint precedes the
    field.
    """
    names = {curve.get("name") for curve in ElementTree.parse(path).iter("curve")}
    return [Use(str(name)) for name in sorted(names)], set()


READERS: dict[str, Callable[[Path], tuple[list[Use], set[str]]]] = {
    ".rviz": rviz,
    ".json": foxglove,
    ".xml": plotjuggler,
}


def number(message: Any, field: str) -> float:
    """Return the number in a message at a path of fields.

    A path is, for example, ``position[0]`` or ``wrench.force.y``.
    """
    for part in field.split("."):
        name, index = re.fullmatch(r"(\w+)(?:\[(\d+)\])?", part).groups()
        message = getattr(message, name)
        message = message if index is None else message[int(index)]
    return float(message)


def curve(golden: SimpleNamespace, name: str) -> float:
    """Return the number in the golden bag that a curve of PlotJuggler displays.

    `name` is the name of the curve: topic and field with slashes.
    """
    topic = max((t for t in golden.types if name.startswith(f"{t}/")), key=len)
    message, path = golden.messages[topic], name.removeprefix(f"{topic}/")
    if golden.types[topic] == "sensor_msgs/msg/JointState":
        joint, field = path.split("/")
        return float(getattr(message, field)[list(message.name).index(joint)])
    return number(message, re.sub(r"/|\.(?=\d)", ".", path))


@pytest.mark.parametrize("path", LAYOUTS, ids=lambda path: path.name)
def test_a_layout_shows_what_a_bag_holds(path: Path, golden: SimpleNamespace) -> None:
    """Each topic, field and frame of a layout exists in the golden bag with its type.

    Each displayed number is finite.
    """
    uses, frames = READERS[path.suffix](path)
    assert uses
    assert frames <= golden.frames
    for use in uses:
        if path.suffix == ".xml":
            assert np.isfinite(curve(golden, use.topic)), use.topic
            continue
        assert use.topic in golden.types, use.topic
        assert use.type in (None, golden.types[use.topic]), use
        if use.field:
            assert np.isfinite(number(golden.messages[use.topic], use.field)), use


def test_there_is_one_for_rviz_and_one_for_foxglove() -> None:
    """The layouts include a file for RViz and a file for Foxglove."""
    assert {".rviz", ".json"} <= {path.suffix for path in LAYOUTS}
