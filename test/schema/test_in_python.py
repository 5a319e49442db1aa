"""Cams and rigs in Python: plain numbers, texts with units, changes and files."""

import math
from pathlib import Path

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import OutputError
from cam_rig.schema.load import config_root
from cam_rig.schema.quantity import UNITS, Quantity

from .conftest import catch_error

CAMS = sorted((config_root() / "cams").glob("*.yaml"))
RIGS = sorted((config_root() / "rigs").glob("*.yaml"))
SEGMENTS = [
    {"law": "poly345", "span": "120 deg", "to": 1.0},
    {"law": "poly345", "span": "120°", "to": 0.0},
    {"law": "dwell", "span": 2.0 * math.pi / 3.0},
]
POINT = {"type": "point", "base_radius": "4 cm"}


def spring_of(**numbers):
    return cam_rig.Rig(mass=1.3, preload=30, **numbers).follower.spring_stiffness


@pytest.mark.parametrize(
    ("written", "si"),
    [
        *((3200, 3200.0), ("3.2 N/mm", 3200.0), ("3.2N/mm", 3200.0), (" 32e2  N/m ", 3200.0)),
        *((np.float64(3200), 3200.0), (np.int64(3200), 3200.0), (np.array(3200.0), 3200.0)),
        (Quantity(given=3.2, unit="N/mm", source="paper"), 3200.0),
    ],
)
def test_a_number_is_plain_or_a_text_with_its_unit(written, si):
    """A number of a rig may be plain, a text with its unit, or a quantity.

    The first two are assumed. A quantity keeps its origin.
    """
    stiffness = spring_of(spring=written)
    assert stiffness.si == pytest.approx(si, rel=1e-15)
    assert stiffness.origin == ("given" if isinstance(written, Quantity) else "assumed")


def test_a_text_may_contain_every_unit_of_a_file():
    for unit, factor in UNITS["length"].items():
        cam = cam_rig.Cam(lift=f"0.5 {unit}", segments=SEGMENTS, follower=POINT)
        assert cam.lift.si == pytest.approx(0.5 * factor)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("3.2", "allowed: a number in N/m, or a text with one and its unit: N/m, N/mm"),
        ("3.2 kg", "has unit 'kg', not a stiffness"),
        ("much", "is 'much'; allowed: a number in N/m"),
        (math.nan, "allowed: finite numbers"),
        (-1.0, "is -1 N/m; allowed: greater than 0 N/m"),
        (True, "is a bool; allowed: a number"),
        (None, "spring_stiffness: missing; it is required"),
        ([1.0, 2.0], "is [1.0, 2.0]; allowed: one number"),
        (object(), "is a object; allowed: a number"),
        ({"given": 3.0}, "unit: missing"),
    ],
)
def test_a_wrong_number_raises_an_error_of_one_line(wrong, message):
    assert message in catch_error(lambda: spring_of(spring=wrong))


@pytest.mark.parametrize("path", [*CAMS, *RIGS], ids=lambda path: path.stem)
def test_a_shipped_file_is_unchanged_by_saving_and_loading(path, tmp_path):
    """A shipped cam or rig that is saved and loaded again is equal.

    The points of a table are saved in a second file.
    """
    load = cam_rig.load_cam if path.parent.name == "cams" else cam_rig.load_rig
    model = load(path)
    model.save(tmp_path / path.name)
    again = load(tmp_path / path.name)
    assert again.replace(title="") == model.replace(title="") or "table" in repr(model.segments)
    assert len(repr(model)) < 300 and "\n" not in repr(model)
    if path.parent.name == "cams":
        expected, actual = (cam_rig.build_law(cam) for cam in (model, again))
        assert np.array_equal(actual.ordinates, expected.ordinates)


def test_a_saved_rig_has_the_name_of_its_file(tmp_path):
    """A rig that is saved has the name of its file. An invalid file name is refused."""
    rig = cam_rig.Rig("bench", mass=1.3, spring="3.2 N/mm", preload=30)
    rig.save(str(tmp_path / "other.yaml"))
    assert cam_rig.load_rig(tmp_path / "other.yaml") == rig.replace(name="other")
    for name in ("a.txt", "Ä b.yaml", "f"):
        assert "allowed" in catch_error(rig.save, tmp_path / name)
    (tmp_path / "folder.yaml").mkdir()
    with pytest.raises(OutputError, match="is a folder"):
        rig.save(tmp_path / "folder.yaml")
    assert {path.name for path in Path(tmp_path).iterdir()} == {"other.yaml", "folder.yaml"}


def test_saving_replaces_an_existing_file_only_with_overwrite(tmp_path):
    """save() replaces an existing file only with overwrite=True.

    The same applies to the file of the points of a table.
    """
    rig, cam = cam_rig.load_rig("tm21"), cam_rig.load_cam("measured")
    for model, suffix in ((rig, "yaml"), (cam, "yaml"), (cam, "csv")):
        folder = tmp_path / f"{model.name}_{suffix}"
        folder.mkdir()
        (folder / f"mine.{suffix}").write_text("before", encoding="utf-8")
        with pytest.raises(OutputError, match=rf"mine.{suffix}: exists already.*overwrite=True"):
            model.save(folder / "mine.yaml")
        assert [file.read_text() for file in folder.iterdir()] == ["before"]
        model.save(folder / "mine.yaml", overwrite=True)
        assert all(file.read_text() != "before" for file in folder.iterdir())


def test_another_spring_makes_the_radiation_assumed():
    """A rig with a replaced spring has assumed radiation constants.

    They were identified with the earlier spring.
    """
    rig = cam_rig.load_rig("tm21")
    assert rig.replace(name="same").radiation == rig.radiation
    changed = rig.replace(spring="6 N/mm")
    assert changed.radiation.gain.origin == "assumed" and rig.radiation.gain.origin == "identified"
    for wrong in ({"sprung": 1.0}, {"spring": "1 kg"}, {"name": "Ä"}, {"follower": 3}):
        assert "allowed" in catch_error(rig.replace, **wrong)


def test_replace_changes_sizes_of_a_cam_and_rejects_wrong_values():
    """replace() changes sizes of a cam, and refuses wrong values with a reason."""
    cam = cam_rig.Cam("lug", lift="20 mm", segments=SEGMENTS, follower=POINT)
    assert cam.replace(base_radius="50 mm", lift=0.01).numbers()["lift"].si == 0.01
    assert cam.title == "lug"
    for wrong, message in (
        ({"segments": SEGMENTS[:2]}, "spans sum to 240"),
        ({"segments": [{"law": "poly354"}]}, "did you mean 'poly345'"),
        ({"follower": {"type": "rollr"}}, "did you mean 'roller'"),
        ({"lift": math.nan}, "finite"),
        ({"lft": 1.0}, "unknown key"),
    ):
        assert message in catch_error(cam.replace, **wrong)
