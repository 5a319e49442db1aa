"""The shipped configuration loads, and no number in it is without an origin."""

from pathlib import Path

import pytest
from ruamel.yaml import YAML

from cam_rig.schema import CamConfig, Library, load_cam, load_published, load_rig, load_scene
from cam_rig.schema.quantity import ORIGINS

CONFIG = Path(__file__).parents[2] / "config"
LOADERS = {"cams": load_cam, "rigs": load_rig, "scenes": load_scene, "published": load_published}
FILES = [path for folder in LOADERS for path in sorted((CONFIG / folder).glob("*.yaml"))]
#: Counts, degrees and fractions of the lift: choices of form, which have no unit and no origin.
BARE = {"to", "degree", "order", "points_per_turn", "ticks_per_turn", "seed"}


def quantities(node, key=""):
    """Every mapping with a unit, and every number that stands alone, with its key."""
    if isinstance(node, dict) and "unit" in node:
        yield key, node
    elif isinstance(node, dict):
        for name, child in node.items():
            yield from quantities(child, name)
    elif isinstance(node, list):
        for child in node:
            yield from quantities(child, key)
    elif isinstance(node, int | float):
        yield key, node


@pytest.mark.parametrize("path", FILES, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_loads_under_its_own_name(path):
    """Each file is valid, and its name inside is its name outside."""
    assert LOADERS[path.parent.name](path).name == path.stem


@pytest.mark.parametrize(
    "path",
    [path for path in FILES if path.parent.name != "published"],
    ids=lambda p: f"{p.parent.name}/{p.stem}",
)
def test_each_number_has_an_origin(path):
    """Given, assumed or identified: every number says which."""
    found = list(quantities(YAML(typ="safe").load(path.read_text(encoding="utf-8"))))
    assert found
    for key, node in found:
        if isinstance(node, dict):
            assert len(set(ORIGINS) & set(node)) == 1, key
        else:
            assert key in BARE, f"{key} is a bare number"


def test_cam_lists_all_its_numbers(cams):
    """`numbers` gives one entry for each quantity of the file, by its key."""
    for name, cam in cams.items():
        raw = YAML(typ="safe").load((CONFIG / "cams" / f"{name}.yaml").read_text(encoding="utf-8"))
        with_unit = [node for _, node in quantities(raw) if isinstance(node, dict)]
        assert len(cam.numbers()) == len(with_unit)
        assert {"lift", "base_radius", "segments[0].span"} <= set(cam.numbers())


def test_library_prefers_the_scenes_own_folder(tmp_path):
    """A name is looked up beside the scene first, then among the shipped files."""
    own = tmp_path / "cams" / "poly345.yaml"
    own.parent.mkdir()
    own.touch()
    library = Library.beside(tmp_path / "scenes" / "x.yaml")
    assert library.path("cams", "poly345") == own
    assert library.path("cams", "poly4567") == CONFIG / "cams" / "poly4567.yaml"


def test_published_levels_cross_where_the_paper_says():
    """With the misprint of eq. 20 corrected, Bézier 15 and TM21 are equally loud at 335 rpm."""
    published = load_published(CONFIG / "published" / "tm21_noise.yaml")
    one, two = published.crossover.between
    rpm = published.crossover.rpm
    assert rpm == 335
    assert abs(published.level(one, rpm) - published.level(two, rpm)) < 0.05  # dB: printed digits


def test_a_copied_cam_is_the_same(cams):
    """Written out and checked again, as a trial with other numbers is: nothing is lost."""
    for cam in cams.values():
        assert CamConfig.model_validate(cam.model_dump(exclude_none=True)) == cam
