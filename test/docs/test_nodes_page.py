"""docs/nodes.md has the topics and parameters of the code's own tables."""

from __future__ import annotations

from cam_rig.messages import topics
from cam_rig.messages.topics import Topic
from cam_rig.nodes.common.parameters import PARAMETERS

from .pages import DOCS, rows

PAGE = DOCS / "nodes.md"


def test_table_of_topics():
    """Name, type, quality of service, how often, owner, and whether a bag holds it."""
    expected = [
        [
            topic.name,
            topic.type.replace("/msg/", "/"),
            f"{'latched' if topic.latched else 'volatile'} {topic.depth}",
            topic.per,
            topic.owner or "any",
            "yes" if topic in topics.RECORDING else "no",
        ]
        for topic in vars(topics).values()
        if isinstance(topic, Topic)
    ]
    assert sorted(rows(PAGE, "topic")) == sorted(expected)


def test_table_of_parameters():
    """Every parameter of a node by its name, and which may change while it runs."""
    described = {}
    for nodes, name, *_, words in rows(PAGE, "node"):
        for node in nodes.split(", "):
            described[node, name] = "**live**" in words
    for node, specs in PARAMETERS.items():
        for spec in specs:
            if spec.name in ("scene", "checkpoint", "at_end"):
                continue
            assert described.pop((node, spec.name)) == spec.live, f"{node} {spec.name}"
    common = {("all but player", "scene"), ("all", "checkpoint"), ("all", "at_end")}
    assert set(described) == common
