"""Factorial studies: the shipped one, and what is refused."""

import pytest
from ruamel.yaml import YAML

from cam_rig.errors import ConfigError
from cam_rig.paper.factorial.design import open_factorial
from cam_rig.schema.load import config_root

SHIPPED = config_root() / "factorials" / "continuity.yaml"


@pytest.fixture
def changed(tmp_path):
    """Write the shipped study with changes."""

    def write(**changes):
        data = YAML(typ="safe").load(SHIPPED.read_text(encoding="utf-8")) | changes
        path = tmp_path / "continuity.yaml"
        with path.open("w", encoding="utf-8") as file:
            YAML(typ="safe").dump(data, file)
        return path

    return write


def test_shipped():
    """Its name is its file's, and every number has an origin."""
    config = open_factorial(SHIPPED)
    assert config.name == SHIPPED.stem
    data = YAML(typ="safe").load(SHIPPED.read_text(encoding="utf-8"))
    numbers = [value for value in data.values() if isinstance(value, dict)]
    assert len(numbers) == 9
    assert all({"given", "assumed"} & set(number) for number in numbers)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"events": {"assumed": [90], "unit": "deg"}}, r"events: are \[90\.0\]; allowed: at least"),
        ({"gentle": {"assumed": [90, 90], "unit": "deg"}}, "gentle: are .* each once"),
        ({"events": {"assumed": [90, 190], "unit": "deg"}}, "events: is 190 deg; allowed: at most"),
        ({"rises": ["poly345", "poly345"]}, "names a law twice"),
        ({"rises": ["poly345", "dwell"]}, r"rises\[1\]: is 'dwell'"),
        ({"squeezed": {"assumed": [400], "unit": "deg"}}, "allowed: at most 360 deg"),
        ({"speeds": 1}, "unknown key"),
    ],
)
def test_refused(changed, changes, words):
    """Levels that make no table, angles that make no cam."""
    with pytest.raises(ConfigError, match=words):
        open_factorial(changed(**changes))
