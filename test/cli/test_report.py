"""Command `cam-rig report`: a scene on one page with all figures and tables."""

import json
import math
import re
from functools import partial
from pathlib import Path

import pytest

from cam_rig.dynamics.jump.any_follower import find_jump, follower_of
from cam_rig.report.command import page_made
from cam_rig.simulation.inputs import build_law
from cam_rig.simulation.scene import load_cam, load_scene
from cam_rig.studies.simulate.study import run_scene

from ..conftest import scene_data
from ..figure_faults import EXPONENT, HYPHEN
from .conftest import GOLDEN, shipped, written
from .conftest import done as run_done

done = partial(run_done, "report")


def sentences(page):
    """Yield the sentences of an HTML page, including those in the cells of tables."""
    parts = re.findall(r"<(p|li|td|th|caption|figcaption|h\d)\b[^>]*>(.*?)</\1>", page, re.DOTALL)
    for _, text in parts:
        plain = " ".join(re.sub("<[^>]*>", " ", text).split())
        yield from re.split(r"(?<=[.!?”])\s+(?=[A-Z“])", plain)


def too_long(page):
    """Return the sentences of a page with more than 30 words."""
    return [sentence for sentence in sentences(page) if len(sentence.split()) > 30]


def untypeset(page):
    """Return sentences and cells with numbers that are not typeset.

    Such numbers have a hyphen as minus, or an exponent such as 1e-9. Commands are excluded.
    """
    text = re.sub(r"<code>.*?</code>", "", page)
    return [words for words in sentences(text) if HYPHEN.search(words) or EXPONENT.search(words)]


def numbered(page, kind):
    """Return the numbers of figures or tables in the order of the page."""
    return [int(n) for n in re.findall(rf' id="{kind}-(\d+)"', page)]


def test_long_sentences_and_untypeset_numbers_are_detected():
    """The helpers detect a sentence of 31 words, and numbers that are not typeset."""
    words = "Word" + 30 * " word"
    page = f"<p>Short. {words}. Short.</p><td class='x'>{words}</td><li>{words[5:]}</li>"
    assert too_long(page) == [f"{words}.", words]
    page = "<p>From -3 to 4.</p><td>1e-9</td><td>−3·10⁸</td><p><code>--at -3</code>, fig. 4-6</p>"
    assert untypeset(page) == ["From -3 to 4.", "1e-9"]


#: Replacement of a picture, which would take a second or two to draw.
PICTURE = "data:image/svg+xml;base64,AAAA"


@pytest.fixture
def undrawn(monkeypatch):
    """Replace figures by a placeholder, because other tests draw them."""
    monkeypatch.setattr("cam_rig.report.document.uris", lambda *_: [PICTURE, PICTURE])


SECTIONS = ("sheet", "summary", "cams", "contour", "turn", "jump", "vibration", "sound", "orders")
OWN_CAM = """
name: own
title: My <measured> cam
lift: {given: 12, unit: mm, source: dial gauge}
follower: {type: flat, base_radius: {given: 30, unit: mm, source: drawing}}
segments:
  - law: table
    span: {given: 360, unit: deg, source: all around}
    file: lifts.csv
    source: dial gauge
    tolerance: {assumed: 0.002, unit: mm, source: gauge}
"""


@pytest.fixture(scope="module")
def own_scene(tmp_path_factory):
    """Scene of custom files: a measured cam, a cam with corners, a lighter follower."""
    lift = build_law(load_cam("poly345"))
    rows = (f"{i},{1e3 * 0.24 * lift(math.radians(i)):.4f}" for i in range(360))
    rig = shipped("rigs", "tm21").replace("name: tm21", "name: mine")
    rig = rig.replace("given: 1.3,", "given: 0.45,")
    scene = scene_data(cams=["own", "harsh"], rig="mine", speeds=[300, 1500], sample_rate=2000)
    name = "worked_example_constant_velocity"  # velocity jumps: no jump speed
    harsh = shipped("cams", name).replace(f"name: {name}", "name: harsh")
    files = {
        "cams/own.yaml": OWN_CAM,
        "cams/harsh.yaml": re.sub(r"(?m)^title: .*", "title: A harsh cam", harsh),
        "cams/lifts.csv": "angle_deg,lift_mm\n" + "\n".join(rows),
        "rigs/mine.yaml": rig,
        "rigs/other.yaml": rig.replace("name: mine", "name: other"),
        "scenes/own.yaml": json.dumps(scene),
    }
    return written(tmp_path_factory.mktemp("person"), files) / "scenes" / "own.yaml"


@pytest.mark.usefixtures("undrawn")
def test_page_of_a_user_defined_scene(own_scene, tmp_path, monkeypatch):
    """The page of a custom scene has all sections, figures and results.

    It has date and command, relative levels and errors of studies, but no private path and no link
    to another host.
    """
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    out, data = tmp_path / "own.html", tmp_path / "own.json"
    done(own_scene, "--out", out, "--json", data)
    page = out.read_text(encoding="utf-8")
    assert tuple(re.findall(r'<(?:section|details) id="(?!more-)(.*?)">', page)) == (
        *SECTIONS,
        "numbers",
    )
    assert page.count("<figure ") == 14
    assert [
        words for words in too_long(page) if "allowed:" not in words
    ] == []  # errors may be long
    assert untypeset(page) == []
    assert not re.search(r"<th[^>]*>(own|harsh)</th", page)  # cams have their titles
    assert "My &lt;measured&gt; cam" in page and "A harsh cam: law" in page
    assert "Levels are relative" in page and "<dd>2023-11-14</dd>" in page
    assert "<code>cam-rig report own.yaml --out own.html</code>" in page
    assert str(tmp_path) not in page and str(own_scene.parents[1]) not in page
    assert "nothing is drawn at random" in page and "predicted" not in page
    for outward in ("<script", "http://", "https://", "<link"):
        assert outward not in page
    results = json.loads(data.read_text())
    assert [(row["cam"], row["rpm"]) for row in results["simulate"]["speeds"]] == [
        (cam, rpm) for cam in ("own", "harsh") for rpm in (300.0, 1500.0)
    ]
    assert results["calibrated"] is False
    (refusal,) = results["refused"]["jump"]
    assert "allowed" in refusal


def test_numbers_of_the_page_equal_those_of_the_commands(own_scene, tmp_path):
    """Jump speeds and rows of the page equal those of `cam-rig jump` and `simulate`.

    Both are on the rig of --rig.
    """
    out, data = tmp_path / "own.md", tmp_path / "own.json"
    done(own_scene, "--rig", "other", "--out", out, "--json", data)
    results = json.loads(data.read_text())
    loaded = load_scene(own_scene)
    follower = follower_of(loaded.rig)
    jump = find_jump(loaded.laws["own"], follower, None).rpm
    rpm = {row["cam"]: row["rpm"] for row in results["jump"]["jump"]}
    assert rpm["own"] == pytest.approx(jump, rel=1e-12)
    assert results["jump"]["run"]["rig"] == "other"
    run = run_scene(loaded)
    row = run.by_speed[1]
    assert results["simulate"]["speeds"] == run.data()["speeds"]
    text = out.read_text(encoding="utf-8")
    assert f"| {row.peak_force:.1f} |" in text and f"| {jump:.1f} |" in text
    assert "Jump speed: one rigid mass, from rest as in steady state." in text
    assert ".md`; with" in text  # no date: the page is reproducible
    assert "<img" not in text


def test_summary_table(tmp_path):
    """The summary has one row per cam with checks, jump speed and levels.

    It also has the speeds at which contact is lost.
    """
    out = tmp_path / "a.md"
    done("quick", "--out", out)
    loaded, text = load_scene("quick"), out.read_text(encoding="utf-8")
    assert "| TM21 concave cam | 7 | 0 | 4 | 2 | 350 | 40.0 | 318.6 | 74.3 | 96.9 |" in text
    assert "| Bézier degree 15 | 5 | 0 | 4 | 0 | – | 0.0 | 547.7 | 78.5 | 85.4 |" in text
    for cam, title in loaded.titles.items():
        assert f"| {title} | {loaded.fitted_origin(cam)} |" in text


def test_recording_is_compared_with_the_run(tmp_path):
    """With --bag the page compares a recording with the run and with published levels."""
    out = tmp_path / "a.md"
    done("quick", "--bag", GOLDEN, "--out", out)
    text = out.read_text(encoding="utf-8")
    assert "The recorded run golden" in text and "r.m.s. difference to published" in text


def test_page_of_a_torsional_scene(tmp_path):
    """The page of a torsional scene has jump speeds and twist, but no orders.

    It states that their force has no closed form.
    """
    out = tmp_path / "a.md"
    done("torsion", "--out", out)
    text = out.read_text(encoding="utf-8")
    assert "two masses, 1.7 s from rest" in text and "| twist [°] |" in text
    assert "a force in closed form" in text


def test_paths_in_the_command_of_a_page(tmp_path, monkeypatch):
    """Paths in the command on a page are relative to the working folder.

    A path elsewhere is shortened to its file name. Relative paths are unchanged.
    """
    monkeypatch.chdir(tmp_path)
    elsewhere = Path("/somebody/secret")
    options = {"--bag": tmp_path / "bags" / "a", "--out": elsewhere / "page.html", "--rig": "tm21"}
    made = page_made(str(elsewhere / "own.yaml"), options)
    assert made.command == "cam-rig report own.yaml --bag bags/a --out page.html --rig tm21"
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86399")
    made = page_made("../own.yaml", {"--out": "a.html"})
    assert (made.command, made.date) == ("cam-rig report ../own.yaml --out a.html", "1970-01-01")
