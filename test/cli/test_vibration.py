"""cam-rig vibration: JSON by cam and speed, the paper's claims tested."""

import json
from functools import partial

import pytest

from .calls import call as run
from .calls import done as run_done

call = partial(run, "vibration")
done = partial(run_done, "vibration")


def test_json(tmp_path):
    """A list over the speeds for each measure of each cam, and the paper's words."""
    words = ("--rpm", 250, "--rpm", 300, "--json", "-", "--plot", tmp_path / "a.png")
    result = done("poly345", "bezier15", *words)
    data = json.loads(result.stdout)
    by = {(row["cam"], row["rpm"]): row for row in data["vibration"]}
    assert list(by) == [(cam, rpm) for cam in ("poly345", "bezier15") for rpm in (250, 300)]
    assert not by["bezier15", 300]["low_dwell"]
    verdicts = [claim["verdict"] for claim in data["claims"] if claim["measure"] != "peak to peak"]
    assert verdicts == ["agrees"] * 3
    assert "read within 31.25° of the lowest lift" in " ".join(result.stderr.split())


def test_cams_that_are_left_are_marked():
    """Of two cams one is left below 450 rpm: marked in the table, told in JSON, not asked of."""
    result = call("poly345", "bezier15", "--rpm", 300, "--rpm", 450, "--rpm", 450, "--json", "-")
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
