"""The documents' pictures are those of today's rig, or this fails: then run ``make pictures``."""

from __future__ import annotations

import json
import urllib.request
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cam_rig.errors import BagError
from cam_rig.schema.load import config_root
from cam_rig.schema.quantity import Quantity
from cam_rig.simulation.scene import LoadedScene, open_scene
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.simulation.simulate import FollowerSimulator
from tools.docs import pictures, screenshot
from tools.docs.album import TurnArchive, gap, read_album
from tools.docs.browser import HEIGHT, WIDTH, Pixels, count, why_no_browser
from tools.docs.pictures import (
    ANIMATION,
    LAID_OUT_BY,
    NOTE,
    STILL,
    VIEWER,
    VIEWER_NOTE,
    draw_pictures,
    inputs,
    numbers,
    photograph_run,
)

from ...viewer.conftest import SmallBag

DOCS = Path(__file__).parents[3] / "docs"
STALE = "the pictures in docs/ are of another rig: run `make pictures`"


@pytest.fixture(scope="module")
def sweep() -> LoadedScene:
    return open_scene(config_root() / "scenes" / "tm21_sweep.yaml")


@pytest.fixture(scope="module")
def note() -> dict[str, dict[str, dict[str, float]]]:
    loaded: dict[str, dict[str, dict[str, float]]] = json.loads((DOCS / NOTE).read_text())
    return loaded


def at_the_highest_speed(loaded: LoadedScene) -> TurnArchive:
    """The sweep's last step alone, simulated."""
    fastest = max(loaded.scene.program.speeds.numbers)
    speeds = Quantity(assumed=[fastest], unit=loaded.scene.program.speeds.unit)
    program = loaded.scene.program.model_copy(update={"speeds": speeds})
    alone = replace(loaded, scene=loaded.scene.model_copy(update={"program": program}))
    album, bench = TurnArchive(alone), FollowerSimulator.of(alone)
    last: CamState | None = None
    for state in cam_states(alone.scene):
        turned = bench.turn_to(state)
        if turned is not None and last is not None:
            album.tick(last, state, turned[1].rows)
        last = state
    return album


def test_the_pictures_are_of_todays_config_and_code(
    sweep: LoadedScene, note: dict[str, object]
) -> None:
    """Digests of the scene's files as read, and of the code that draws."""
    for kind, digests in inputs(sweep).items():
        assert note[kind] == digests, STALE


@pytest.mark.skipif(why_no_browser() is not None, reason=f"no browser: {why_no_browser()}")
def test_the_viewers_picture_is_of_todays_layout(sweep: LoadedScene) -> None:
    """Asked for only where a browser is, for nowhere else can it be made anew."""
    note = json.loads((DOCS / VIEWER_NOTE).read_text())
    assert note == inputs(sweep, LAID_OUT_BY), STALE


def test_the_viewers_picture_shows_every_curve() -> None:
    """Its colours are kept to within what the eye, and a test of the browser, takes for equal."""
    with Image.open(DOCS / VIEWER) as picture:
        pixels = np.asarray(picture.convert("RGB"))
    assert pixels.shape == (HEIGHT, WIDTH, 3)
    for colour in screenshot.SHOWN:
        assert count(pixels, colour) > 40, f"#{colour >> 8:06x}"


def test_a_photograph_is_of_the_bags_own_layout(
    bag: SmallBag, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Served as a page, asked for the colours that must be seen, and written beside its note."""
    pixels = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)

    def photograph(address: str, colours: tuple[int, ...], settled: int) -> Pixels:
        assert urllib.request.urlopen(address).status == 200
        assert settled in colours and colours == screenshot.SHOWN
        return pixels

    monkeypatch.setattr(screenshot, "photograph", photograph)
    files = photograph_run(bag.path, bag.loaded, tmp_path)
    assert [path.name for path in files] == [VIEWER, VIEWER_NOTE]
    with Image.open(tmp_path / VIEWER) as picture:
        np.testing.assert_array_equal(np.asarray(picture), pixels)
    assert json.loads((tmp_path / VIEWER_NOTE).read_text()) == inputs(bag.loaded, LAID_OUT_BY)


@pytest.mark.long
@pytest.mark.skipif(why_no_browser() is not None, reason=f"no browser: {why_no_browser()}")
def test_the_viewer_is_photographed(bag: SmallBag, tmp_path: Path) -> None:
    """A bag's own layout in Chromium, when it is loaded, and a note beside it."""
    files = photograph_run(bag.path, bag.loaded, tmp_path)
    assert [path.name for path in files] == [VIEWER, VIEWER_NOTE]
    with Image.open(tmp_path / VIEWER) as picture:
        assert picture.size == (WIDTH, HEIGHT)


def test_the_pictures_show_todays_motion(
    sweep: LoadedScene, note: dict[str, dict[str, dict[str, float]]]
) -> None:
    """Lift, force, acceleration and gap at the highest speed, simulated anew.

    The samples lie elsewhere in the turn than the bag's, so a peak may differ by a part of a step.
    """
    album = at_the_highest_speed(sweep)
    assert len(album.turns) == len(note["numbers"]) == 3
    for (cam, _), turn in album.turns.items():
        assert numbers(sweep, turn) == pytest.approx(note["numbers"][cam], rel=0.01), STALE


def test_another_cam_would_be_noticed(sweep: LoadedScene, note: dict[str, object]) -> None:
    """A number of a cam that changes makes the note old."""
    cam = sweep.cams["tm21"]
    other = cam.model_copy(update={"lift": Quantity(assumed=0.006, unit="m")})
    changed = replace(sweep, cams=sweep.cams | {"tm21": other})
    assert inputs(changed)["config"] != note["config"]


def test_the_animation_is_short_and_small() -> None:
    """One turn that moves, under 2 MB."""
    path = DOCS / ANIMATION
    assert path.stat().st_size < 2_000_000
    with Image.open(path) as film:
        frames = []
        for i in range(film.n_frames):
            film.seek(i)
            frames.append(np.asarray(film.convert("RGB"), dtype=np.int16))
    assert len(frames) == 72
    changes = [np.abs(a - b).max() for a, b in pairwise(frames)]
    assert min(changes) > 60


def test_pictures_of_a_bag(bag: SmallBag, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All files are there; the cam that jumps highest is the one that is animated."""
    album = read_album(bag.path)
    monkeypatch.setattr(pictures, "FRAMES", 6)
    files = draw_pictures(album, lambda path: path.write_bytes(b"noise"), tmp_path)  # type: ignore[arg-type, return-value]
    assert [path.name for path in files] == [ANIMATION, STILL, "small.png", NOTE]
    found = json.loads((tmp_path / NOTE).read_text())["numbers"]
    turn = album.turn("poly345", 700.0)
    assert found["poly345"]["greatest_gap_mm"] == round(float(gap(bag.loaded, turn).max()) * 1e3, 6)
    with Image.open(tmp_path / STILL) as still:
        assert still.size[0] > 500
    with pytest.raises(BagError, match="no whole turn of 'poly345' at 500 rpm"):
        album.turn("poly345", 500.0)
