"""A cam has one look for ever: by its name, told apart by the colour-blind and in grey."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from cam_rig.laws.catalogue import rise_curves
from cam_rig.laws.segments import NAMED_RISES
from cam_rig.schema import load_scene, load_tables
from cam_rig.schema.load import config_root
from cam_rig.show import looks as pictures
from cam_rig.show.looks import COLOURS, DASHES, MARKERS, NAMES, SAME, CamLook, cam_look, of_cam

#: Cams that the report draws on each other: of Table 2, and those whose contact is compared.
TABLE_2 = ("bezier15", "poly345", "poly4567", "cycloidal", "bezier_segments")
CONTACT = (*TABLE_2, "flat", "oscillating_flat", "point")


def test_every_shipped_cam_and_rise_has_its_place_once() -> None:
    """The table is complete, so that no shipped name is hashed."""
    cams = {path.stem for path in (config_root() / "cams").glob("*.yaml")}
    assert len(NAMES) == len(set(NAMES))
    assert set(NAMES) == (cams | set(NAMED_RISES)) - set(SAME)


def test_cams_shown_together_have_different_colours() -> None:
    """Those of each shipped scene, of Table 2 and of the comparison of contacts."""
    scenes = [load_scene(path).cams for path in (config_root() / "scenes").glob("*.yaml")]
    tables = load_tables(config_root() / "published" / "tables" / "paper.yaml")
    assert list(tables.table_2_jump) == list(TABLE_2)
    for cams in (*scenes, CONTACT):
        assert len({of_cam(cam) for cam in cams}) == len(cams), cams


def test_lines_are_told_apart_in_grey() -> None:
    """Dash and, where it is drawn, marker: a pair of its own for every shipped name."""
    looks = [cam_look(name) for name in NAMES]
    assert len({(str(one.dash), one.marker if one.marked else "") for one in looks}) == len(NAMES)
    assert len(set(map(str, DASHES))) == len(set(MARKERS)) == len(COLOURS)


def test_points_are_told_apart_in_grey() -> None:
    """Two cams of one marker differ in colour, and their luminances by 10 % of white at least."""
    shown = [cam_look(name) for name in ("tm21", *CONTACT)]
    for one, other in combinations(shown, 2):
        differ = abs(_luminance(one.colour) - _luminance(other.colour)) >= 0.1
        assert one.marker != other.marker or differ


def test_a_name_of_ones_own_looks_like_no_shipped_cam() -> None:
    """Its pair of dash and marker is in no table; the look of a name is a constant, in any run."""
    rng = np.random.default_rng(18)
    shipped = {(str(look.dash), look.marker) for look in map(cam_look, NAMES)}
    names = ["".join(rng.choice(list("abcdefgh_123"), 8)) for _ in range(300)]
    looks = [cam_look(name) for name in names]
    assert not shipped & {(str(one.dash), one.marker) for one in looks}
    assert {one.colour for one in looks} == set(COLOURS)
    assert cam_look("mine") == CamLook(0xEE6677FF, DASHES[3], "s", marked=True)


def test_rises_that_are_one_curve_look_the_same() -> None:
    """The table of equal curves is true, and complete."""
    motions = {name: rise_curves(name).motion for name in NAMED_RISES}
    equal = [
        pair for pair in combinations(motions, 2) if np.array_equal(*(motions[n] for n in pair))
    ]
    assert sorted(tuple(sorted(pair)) for pair in equal) == sorted(SAME.items())
    assert all(cam_look(one) == cam_look(other) for one, other in equal)


@pytest.mark.parametrize(
    ("found", "shown"),
    [
        (pictures.web(cam_look("bezier15").colour), "#4477aa"),
        (pictures.web(pictures.tint(pictures.BLUE)), "#bfdcec"),
        (pictures.in_words("poly345"), "Polynomial 3-4-5"),
        (pictures.in_words("bezier15"), "Bézier degree 15"),
        (pictures.in_words("bezier4_start"), "Bézier degree 4, start"),
        (pictures.in_words("tm21"), "TM21"),
        (pictures.in_words("my_cam"), "My cam"),
        (pictures.shortened("Polynomial 3-4-5", 16), "Polynomial 3-4-5"),
        (pictures.shortened("Cam of the left inlet valve, v2", 16), "Cam of t…lve, v2"),
        (pictures.four_digits(28706.4), "28710"),
        (pictures.four_digits(-0.25), "−0.25"),
        (pictures.log_tick(300.0), "300"),
        (pictures.log_tick(3e-9), "3·10⁻⁹"),
    ],
)
def test_words_of_pictures(found: str, shown: str) -> None:
    """Names in words, titles that a legend holds, numbers as they are printed."""
    assert found == shown


def test_reach_and_distances() -> None:
    """An axis has room beyond a difference, and 1 where it is rounding; distances from a strip."""
    assert (pictures.reach(20.0), pictures.reach(5e-9)) == (pytest.approx(23.0), 1.0)
    points, strip = np.array([[0.5, 2.0], [4.0, 4.0]]), np.array([[0.0, 0.0], [1.0, 0.0]])
    assert pictures.distances(points, strip).tolist() == [2.0, 5.0]


def _luminance(colour: int) -> float:
    """Relative luminance of sRGB from 0 to 1 (IEC 61966-2-1)."""
    channels = np.array([colour >> shift & 255 for shift in (24, 16, 8)]) / 255.0
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])
