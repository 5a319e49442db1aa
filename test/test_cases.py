"""Tests that commands compute the expected numbers from files of other programs.

`cases/expected.csv` has a row for each number, with its absolute tolerance in the unit of the row.
The values are those of formulas that were evaluated independently of cam_rig.
"""

import csv
import json
import shlex
from itertools import groupby
from pathlib import Path
from shutil import copytree

import pytest
import yaml

from .cli.conftest import call

CASES = Path(__file__).parent / "cases"
#: Factors that convert a unit in the table of expected numbers to SI, the units of the JSON.
SI = {"mm": 1e-3, "um": 1e-6, "mm/rad": 1e-3, "mm/rad^2": 1e-3, "deg": 0.017453292519943295}


def commands():
    """Yield the rows of the table of expected numbers, grouped by case and command."""
    with (CASES / "expected.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for (case, command), found in groupby(rows, lambda row: (row["case"], row["command"])):
        name = f"{case}-{shlex.split(command)[2 if 'fit' not in command else 3]}"
        yield pytest.param(case, command, list(found), id=name)


def of_spline(data, written, name, _):
    """Return a number of a cam that the command `fit cam` fitted to lift readings.

    `name` selects a number of the fitted spline, its dwell, its outliers or the written cam file.
    """
    if name.startswith("outlier_line"):
        return data["outliers"][int(name.rpartition("_")[2]) - 1]["line"]
    found = data["spline"] | {"outlier_count": len(data["outliers"])}
    if len(data["dwells"]) == 1:
        found["dwell_span"] = data["dwells"][0]["span"]
    if written:
        found["base_radius"] = 1e-3 * next(iter(written["follower"]["base_radius"].values()))
    return found[name]


def of_contour(data, written, name, place):
    """Return a number of a measured contour, or the lift (m) of the written law.

    The lift is at the angle `place`.
    """
    if not place:
        return data["contours"][0][name]
    angle = float(place.removesuffix("deg"))
    return 1e-3 * next(s for a, s in written.items() if abs(a - angle) < 1e-9)


def of_comparison(data, _, name, place):
    """Return a number of the comparison of a bag with a simulation at a speed.

    `name` can also select the number of used or skipped readings.
    """
    if name.endswith(("_readings", "_skipped")):
        quantity, _, count = name.partition("_")
        return next(row for row in data["readings"] if row["quantity"] == quantity)[count]
    rpm = float(place.removesuffix("rpm"))
    return float(next(row for row in data["departures"] if abs(row["rpm"] - rpm) < 1.0)[name])


def of_orders(data, _, name, place):
    """Return a number of an order (multiple of the cam speed) of the force."""
    order = float(place.removeprefix("order"))
    return next(row for row in data["orders"] if row["order"] == order)[name]


def of_run(data, _, name, __):
    """Return the minimum or maximum of force or torque at the only speed of a run."""
    end, what = name.split("_")
    return data["speeds"][0][f"{'peak' if end == 'max' else 'min'}_{what}"]


READERS = {
    "spline": of_spline,
    "contours": of_contour,
    "departures": of_comparison,
    "orders": of_orders,
    "jump": lambda data, *_: data["jump"][0]["rpm"],
    "speeds": of_run,
}


def number(data, written, quantity):
    """Return a quantity from a command's JSON output, or from the files that it wrote.

    `quantity` is a name, or name@place.
    """
    name, _, place = quantity.partition("@")
    reader = next(READERS[key] for key in READERS if key in data)
    return reader(data, written, name, place)


@pytest.mark.parametrize(("case", "command", "rows"), commands())
def test_a_file_as_people_have_it_gives_the_right_numbers(
    tmp_path, monkeypatch, case, command, rows
):
    """The command of a case succeeds, and its numbers are within their tolerances.

    The files are as users have them, such as a table of readings in another unit.
    """
    copytree(CASES / case, tmp_path / case)
    monkeypatch.chdir(tmp_path / case)
    done = call(*shlex.split(command)[1:], "--json", "-")
    assert done.exit_code == 0, done.stderr
    data, written = json.loads(done.stdout), None
    if "--out" in command:
        out = Path(command.split("--out ")[1])
        text = out.read_text(encoding="utf-8")
        if out.suffix == ".csv":
            written = {float(a): float(s) for a, s in list(csv.reader(text.splitlines()))[1:]}
        else:
            written = yaml.safe_load(text)
    for row in rows:
        found = number(data, written, row["quantity"]) / SI.get(row["unit"], 1.0)
        assert found == pytest.approx(float(row["value"]), abs=float(row["tolerance"]), rel=0.0), (
            row
        )


@pytest.mark.parametrize("cam", ["drop", "half_way"])
@pytest.mark.parametrize("command", ["profile", "law", "jump"])
def test_a_forgotten_fall_is_refused(tmp_path, cam, command):
    """A cam file whose last segment does not return to zero lift is refused.

    The commands `profile` and `law` refuse it. The error contains the lift of the law and that of
    the file.
    """
    copytree(CASES / "fall_forgotten", tmp_path / "case")
    done = call(command, tmp_path / "case" / "cams" / f"{cam}.yaml")
    lift = {"drop": "0 mm", "half_way": "7.5 mm"}[cam]
    assert done.exit_code != 0
    assert f"the law rises by {lift}, lift is 15 mm" in " ".join(done.stderr.split())


def test_a_radius_is_refused_for_a_roller(tmp_path):
    """`fit cam` refuses a column of radii for a roller.

    The error contains the column and an option that accepts radii.
    """
    copytree(CASES / "radius_is_no_lift", tmp_path / "case")
    done = call("fit", "cam", tmp_path / "case" / "radius.csv", "--roller-radius", 8)
    assert done.exit_code == 2
    words = " ".join(done.stderr.split())
    assert "'radius_mm' is a radius" in words and "--follower point" in words


def test_a_rig_without_sound_is_compared_and_reported(tmp_path, monkeypatch):
    """`compare` and `report` accept a rig without radiation, and leave out the level.

    Both outputs contain the missing key.
    """
    copytree(CASES / "counter_overflows", tmp_path / "case")
    monkeypatch.chdir(tmp_path / "case")
    rig = Path("bench/rigs/plain.yaml")
    rig.write_text(rig.read_text(encoding="utf-8").partition("radiation:")[0], encoding="utf-8")
    topics = "angle=/enc:turn/4096 lift=/joint_states.position[follower]"
    done = call("compare", "i16", "bench/scenes/bench.yaml", "--topics", topics, "--json", "-")
    assert done.exit_code == 0, done.stderr
    data = json.loads(done.stdout)
    assert all(row["lift_within_noise"] for row in data["departures"])
    assert "sound level left out: rig plain has no radiation" in str(data["run"])
    done = call("report", "bench/scenes/bench.yaml", "--out", "page.md")
    assert done.exit_code == 0, done.stderr
    page = " ".join(Path("page.md").read_text(encoding="utf-8").split())
    assert "Sound level left out: rig plain has no radiation" in page
