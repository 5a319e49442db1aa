"""Tests of the tables in docs/nodes.md and docs/results.md against the code."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import cam_rig
from cam_rig.bag.reader import read_counts
from cam_rig.errors import ConfigError
from cam_rig.messages import topics
from cam_rig.messages.topics import Topic
from cam_rig.nodes.parameters import PARAMETERS
from cam_rig.testing.running_rig import isolated_domain
from tools.docs import results as results_page
from tools.docs.results import results, sources_of

from ..cli.conftest import done
from .conftest import DOCS, ROOT, rows, text

PAGE = DOCS / "nodes.md"


def test_table_of_topics():
    """The table of topics in nodes.md agrees with the topics of the code.

    It has the name, type, QoS, rate and publisher of each topic, states whether a bag contains the
    topic, and describes its content.
    """
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
    """The table of nodes.md lists the parameters of each node, and marks live ones.

    `scene` and `on_finish` are listed once for all nodes.
    """
    described = {}
    for nodes, name, *_, words in rows(PAGE, "node"):
        for node in nodes.split(", "):
            described[node, name] = "**live**" in words
    for node, specs in PARAMETERS.items():
        for spec in specs:
            if spec.name in ("scene", "on_finish"):
                continue
            assert described.pop((node, spec.name)) == spec.live, f"{node} {spec.name}"
    common = {("all but player", "scene"), ("all", "on_finish")}
    assert set(described) == common


def size_of(bag: Path) -> list[str]:
    """Return ticks, messages and size in MB of a bag as texts, as printed on the page.

    A tick is the interval between two published cam states.
    """
    counts = read_counts(bag)
    size = sum(file.stat().st_size for file in bag.iterdir())
    return [str(counts[topics.PRESSURE.name]), str(sum(counts.values())), f"{size / 1e6:.1f} MB"]


def test_the_bag_of_quick():
    """The size of the bag of `quick` in nodes.md is that of the golden bag.

    The golden bag is the reference recording of this scene in bags/golden, with one tick (cam
    state) per turn.
    """
    asked, *figures = rows(PAGE, "`ticks_per_turn`")[0]
    assert asked == "1" and figures == size_of(ROOT / "bags" / "golden")


@pytest.mark.long
@pytest.mark.ros
def test_the_bag_of_quick_with_more_ticks(tmp_path):
    """The bag size in nodes.md for more ticks per turn is that of a run.

    A tick is the interval between two cam states. The run is that of the scene quick. The number of
    messages agrees to 1 %, because rounding decides at which angle of a dwell the force is largest,
    and thus how many messages are published.
    """
    ticks, *figures = rows(PAGE, "`ticks_per_turn`")[1]
    scene, bag = tmp_path / "scenes" / "quick.yaml", tmp_path / "bag"
    scene.parent.mkdir()
    text = (ROOT / "config" / "scenes" / "quick.yaml").read_text(encoding="utf-8")
    scene.write_text(text.replace("schedule:", f"schedule:\n  ticks_per_turn: {ticks}"))
    with isolated_domain():
        done("run", scene, "--bag", bag)
    found = size_of(bag)
    assert figures[::2] == found[::2]
    assert int(found[1]) == pytest.approx(int(figures[1]), rel=0.01)


# -- docs/results.md lists every result of the code, with all tables and columns


def test_the_page_of_results_is_that_of_today():
    """docs/results.md equals the page that is generated from the result classes.

    `make docs` generates the page again.
    """
    assert text(results_page.PAGE) == results_page.page()


def test_every_result_has_a_schema_of_its_own_and_something_that_gives_it():
    """Each result has a unique schema with a version, and a command or function."""
    schemas = [one.schema for one in results()]
    assert len(set(schemas)) == len(schemas) > 20
    for one in results():
        assert re.fullmatch(r"cam_rig\.[a-z][a-z0-9_]*\.[1-9]\d*", one.schema), one
        assert sources_of(one), (
            f"{one.__name__}: name it in COMMANDS_OF_SCHEMA of tools/docs/results.py"
        )


def test_every_key_is_in_snake_case_and_stands_once():
    """Names of tables and columns are in snake case, and unique within their table.

    Data are in SI, so no column is in mm, µm, degrees, %, ms or MPa.
    """
    for one in results():
        assert one.columns, one
        for table, columns in one.columns.items():
            keys = [column.key for column in columns]
            assert len(set(keys)) == len(keys), (one, table)
            assert all(re.fullmatch(r"[a-z][a-z0-9_]*", key) for key in [table, *keys]), keys
            assert not {column.si_unit for column in columns} & {"mm", "µm", "°", "%", "ms", "MPa"}


#: Speeds (rpm) and levels (dB) of the 3-4-5 cam.
LEVELS = np.array([[200, 78.3], [250, 81.7], [300, 83.4], [350, 85.8], [400, 90.9]])


@pytest.mark.slow
def test_every_figure_is_there():
    """Each `plot_function` of a result is the name of an existing function.

    The figure of a result without such a function raises ConfigError that refers to the tables.
    """
    drawn = [one.plot_function for one in results() if one.plot_function]
    assert len(drawn) > 15
    for module, name in (place.split(":") for place in drawn):
        assert callable(getattr(import_module(module), name)), (module, name)
    with pytest.raises(ConfigError, match=r"SoundFit.* has no figure; use its tables"):
        cam_rig.fit_sound(LEVELS, "tm21_sweep").plot()


def test_a_result_has_the_tables_of_the_page():
    """The data of a result have exactly the declared tables and columns.

    The results are those that are computed quickly: a contour, a motion, a sound level and a run
    that is read from a bag.
    """
    cam, rig = cam_rig.load_cam("conjugate"), cam_rig.load_rig("tm21")
    motion = cam_rig.simulate(cam_rig.build_law(cam), rig, rpm=300, turns=2, sample_rate=1000)
    run = cam_rig.read_bag(ROOT / "bags" / "golden")
    for found in (cam_rig.contour(cam, 36), motion, cam_rig.sound_level(motion), run):
        data = found.data()
        assert data.pop("schema") == found.schema
        assert data.keys() == found.columns.keys()
        for key, columns in found.columns.items():
            rows = data[key] if isinstance(data[key], list) else [data[key]]
            assert rows or key in ("events", "messages")
            assert all(list(row) == [column.key for column in columns] for row in rows)
