"""cam-rig factorial and vibration: JSON for programs, a plot, the paper's claims, refusals."""

import json
import math
from functools import partial
from pathlib import Path
from shutil import copy

import pytest

from .conftest import call as run
from .conftest import done as run_done

call = partial(run, "factorial")
done = partial(run_done, "factorial")


@pytest.fixture
def small(sweep, tmp_path):
    """The shipped study with two laws and two angles."""
    return Path(copy(sweep.parents[1] / "factorials" / "continuity.yaml", tmp_path))


def test_json_and_plot(small):
    """Values, shares that add up, and the conclusions; a picture, and the tables as CSV."""
    plot, csv = small.parent / "a.png", small.parent / "a.csv"
    result = done(small, "--jobs", 1, "--json", "-", "--plot", plot, "--csv", csv)
    data = json.loads(result.stdout)
    rows = {(one["design"], one["effect"], one["in_contact"]): one for one in data["variance"]}
    designs = {"same angles", "same acceleration"}  # all are C2 and above
    assert {design for design, _, _ in rows} == designs
    for one in rows.values():
        assert one["law"] + one["angle"] + one["interaction"] == pytest.approx(1.0)
    residual = rows["same acceleration", "residual", False]
    assert (residual["cells_without_contact"], residual["fastest"]) == (1, pytest.approx(400.0))
    cells = [one for one in data["cells"] if one["design"] == "same acceleration"]
    assert [one["law"] for one in cells if one["jump"] < residual["fastest"]] == ["poly345"]
    assert len(data["cells"]) == 8
    assert "lose contact below 400 rpm" in " ".join(result.stderr.split())
    assert data["conclusions"]["advantage"] == "slopes"
    assert len(data["cams"]) == 5
    assert [round(math.degrees(one["span"])) for one in data["compressed"]] == [300]
    about = {key: 0.0 for key in rows}
    for one in data["effects"]:
        about[one["design"], one["effect"], one["in_contact"]] += one["above_mean"]
    assert max(map(abs, about.values())) < 1e-9
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert csv.read_text(encoding="utf-8").startswith(
        "design,effect,in_contact,laws,angles,law,between_classes"
    )


@pytest.mark.parametrize(
    ("key", "old", "new", "words"),
    [
        ("rises", "poly4567]", "constant_velocity]", "is 'constant_velocity', whose velocity"),
        ("reference", "reference: poly345", "reference: bezier4_start", "is 'bezier4_start'"),
        ("residual", "390, 400]", "390, 4000]", "speed is 4000 rpm; allowed: 1 to 3139 rpm"),
        ("noise_in_contact", "assumed: 200", "assumed: 0.001", "allowed: at least 1 rpm"),
    ],
)
def test_a_study_that_cannot_be_run(small, key, old, new, words):
    """A rise that throws the follower off, a speed that means nothing: file or study, and key."""
    text = small.read_text(encoding="utf-8")
    assert old in text
    small.write_text(text.replace(old, new), encoding="utf-8")
    result = call(small)
    assert result.exit_code == 2
    assert "continuity" in result.stderr
    assert key in result.stderr
    assert words in result.stderr


def test_an_unknown_rig(small):
    """Of the study is named."""
    small.write_text(small.read_text(encoding="utf-8").replace("tm21", "no_such_rig"))
    result = call(small, "--json", small.parent / "a.json")
    assert result.exit_code == 2
    assert "no_such_rig.yaml: no such file" in result.stderr
    assert [p.name for p in small.parent.iterdir()] == ["continuity.yaml"]


# -- cam-rig vibration: JSON by cam and speed, the paper's claims tested ----------------------


def test_json_of_vibration(tmp_path):
    """A list over the speeds for each measure of each cam, and the paper's words."""
    words = ("--rpm", 250, "--rpm", 300, "--json", "-", "--plot", tmp_path / "a.png")
    result = run_done("vibration", "poly345", "bezier15", *words)
    data = json.loads(result.stdout)
    by = {(row["cam"], row["rpm"]): row for row in data["vibration"]}
    assert list(by) == [(cam, rpm) for cam in ("poly345", "bezier15") for rpm in (250, 300)]
    assert not by["bezier15", 300]["low_dwell"]
    verdicts = [claim["verdict"] for claim in data["claims"] if claim["measure"] != "peak to peak"]
    assert verdicts == ["agrees"] * 3
    assert "read within 31.25° of the lowest lift" in " ".join(result.stderr.split())


def test_cams_that_are_left_are_marked():
    """Of two cams one is left below 450 rpm: marked in the table, told in JSON, not asked of."""
    result = run(
        "vibration", "poly345", "bezier15", "--rpm", 300, "--rpm", 450, "--rpm", 450, "--json", "-"
    )
    data = json.loads(result.stdout)
    by = {(row["cam"], row["rpm"]): row for row in data["vibration"]}
    lost = {key: row["contact_lost"] for key, row in by.items()}
    assert [key for key in lost if lost[key]] == [("poly345", 450)]
    assert len(lost) == 4
    assert by["poly345", 300]["contact_lost_rpm"] == pytest.approx(413.44, abs=0.01)
    assert "poly345 †" in result.stderr
    assert "bezier15 * †" not in result.stderr
    assert "contact is lost at 1 of 2 speeds" in result.stderr
    verdicts = {c["measure"]: c["verdict"] for c in data["claims"] if c["source"] == "fig. 5"}
    assert verdicts == {"residual amplitude": "agrees", "peak to peak": "disagrees"}
