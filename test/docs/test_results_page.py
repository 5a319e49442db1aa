"""docs/results.md is of the code: every result, each of its tables, each of their columns."""

from __future__ import annotations

import re
from importlib import import_module

import pytest

import cam_rig
from cam_rig.errors import ConfigError
from tools.docs.results import PAGE, given_by, page, results

from .pages import ROOT, text


def test_the_page_of_results_is_that_of_today():
    """It is what the columns say; else run ``make docs``."""
    assert text(PAGE) == page()


def test_every_result_has_a_schema_of_its_own_and_something_that_gives_it():
    """A name, which no other has, and a version; a command or a function of the package."""
    schemas = [one.schema for one in results()]
    assert len(set(schemas)) == len(schemas) > 20
    for one in results():
        assert re.fullmatch(r"cam_rig\.[a-z][a-z0-9_]*\.[1-9]\d*", one.schema), one
        assert given_by(one), f"{one.__name__}: name it in GIVEN_BY of tools/docs/results.py"


def test_every_key_is_in_snake_case_and_stands_once():
    """Tables are named so too, and a column's unit is none of those that only people read."""
    for one in results():
        assert one.columns, one
        for table, columns in one.columns.items():
            keys = [column.key for column in columns]
            assert len(set(keys)) == len(keys), (one, table)
            assert all(re.fullmatch(r"[a-z][a-z0-9_]*", key) for key in [table, *keys]), keys
            assert not {column.si for column in columns} & {"mm", "µm", "°", "%", "ms", "MPa"}


def test_every_figure_is_there():
    """``drawn_by`` names a function, which takes the result first."""
    drawn = [one.drawn_by for one in results() if one.drawn_by]
    assert len(drawn) > 15
    for module, name in (place.split(":") for place in drawn):
        assert callable(getattr(import_module(module), name)), (module, name)
    with pytest.raises(ConfigError, match=r"plot: Readings.* has no figure; allowed: its tables"):
        cam_rig.readings().plot()


def test_a_result_has_the_tables_of_the_page():
    """Of what is computed at once: by their keys, with these columns, and no other."""
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
