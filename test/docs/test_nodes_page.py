"""docs/nodes.md has the topics and parameters of the code's own tables."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from cam_rig.bag.reader import read_counts
from cam_rig.cli.main import app
from cam_rig.messages import topics
from cam_rig.messages.topics import Topic
from cam_rig.nodes.parameters import PARAMETERS
from cam_rig.testing.running_rig import isolated_domain

from .pages import DOCS, ROOT, rows

PAGE = DOCS / "nodes.md"


def test_table_of_topics():
    """Name, type, QoS, how often, owner, whether a bag holds it; then its content."""
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
    shown = rows(PAGE, "topic")
    assert sorted(row[:6] for row in shown) == sorted(expected)
    assert all(row[6] for row in shown)


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


def size_of(bag: Path) -> list[str]:
    """Ticks, messages and size of a bag, as the page has them."""
    counts = read_counts(bag)
    size = sum(file.stat().st_size for file in bag.iterdir())
    return [str(counts[topics.PRESSURE.name]), str(sum(counts.values())), f"{size / 1e6:.1f} MB"]


def test_the_bag_of_quick():
    """As the golden bag is, which tests hold to be what a run makes."""
    asked, *figures = rows(PAGE, "`ticks_per_turn`")[0]
    assert asked == "1"
    assert figures == size_of(ROOT / "bags" / "golden")


@pytest.mark.long
@pytest.mark.ros
def test_the_bag_of_quick_with_more_ticks(tmp_path):
    """As a run makes it."""
    ticks, *figures = rows(PAGE, "`ticks_per_turn`")[1]
    scene, bag = tmp_path / "scenes" / "quick.yaml", tmp_path / "bag"
    scene.parent.mkdir()
    text = (ROOT / "config" / "scenes" / "quick.yaml").read_text(encoding="utf-8")
    scene.write_text(text.replace("program:", f"program:\n  ticks_per_turn: {ticks}"))
    with isolated_domain():
        done = CliRunner().invoke(app, ["run", str(scene), "--bag", str(bag)])
    assert done.exit_code == 0, done.output
    assert figures == size_of(bag)
