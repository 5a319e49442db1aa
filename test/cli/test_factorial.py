"""cam-rig factorial: two processes, JSON for programs, a plot, refusals in a line."""

import json

import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

from cam_rig.cli.main import app
from cam_rig.schema.load import config_root


def call(*arguments):
    return CliRunner().invoke(app, ["factorial", *(str(a) for a in arguments)])


@pytest.fixture
def small(tmp_path):
    """The shipped study with two laws and two angles."""
    data = YAML(typ="safe").load(
        (config_root() / "factorials" / "continuity.yaml").read_text(encoding="utf-8")
    )
    data["rises"] = ["poly345", "poly4567"]
    levels = {"events": [105, 135], "gentle": [110, 130], "squeezed": [300], "noise": [200]}
    for key, numbers in levels.items():
        data[key]["assumed"] = numbers
    path = tmp_path / "continuity.yaml"
    with path.open("w", encoding="utf-8") as file:
        YAML(typ="safe").dump(data, file)
    return path


def test_json_and_plot(small):
    """Values, shares that add up, and the answer; a picture."""
    plot = small.parent / "a.png"
    result = call(small, "--json", "-", "--plot", plot)
    assert result.exit_code == 0
    data = json.loads(result.stdout)
    assert set(data) == {"answer", "designs", "cams", "squeezed", "advantage"}
    design = data["designs"]["same acceleration"]
    assert design["continuity"] == [2, 3]
    assert data["designs"].keys() == {"same angles", "same acceleration"}  # all are C2 and above
    residual = design["effects"]["residual"]
    assert residual["left_below_rpm"] == pytest.approx(400.0)
    assert residual["cells_left"] == [[True, False], [False, False]]
    assert "leave the cam below 400 rpm" in " ".join(result.stderr.split())
    for effect in design["effects"].values():
        assert sum(effect["shares"].values()) == pytest.approx(1.0)
        assert [len(row) for row in effect["values"]] == [2, 2]
    assert len(data["cams"]) == 5
    assert data["squeezed"].keys() == {"300"}
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_refusals(small):
    """An unknown study, an unknown rig."""
    assert "no_such.yaml: no such file; there are: continuity" in call("no_such").stderr
    small.write_text(small.read_text(encoding="utf-8").replace("tm21", "no_such_rig"))
    result = call(small, "--json", small.parent / "a.json")
    assert result.exit_code == 2
    assert "no_such_rig.yaml: no such file" in result.stderr
    assert [p.name for p in small.parent.iterdir()] == ["continuity.yaml"]
