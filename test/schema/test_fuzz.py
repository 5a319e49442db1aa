"""Whatever is in a YAML file, the loader gives a checked config or one line of error."""

import copy
import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from cam_rig.errors import CamRigError
from cam_rig.schema.load import config_root, read_yaml
from cam_rig.simulation.scene import open_scene

from .fuzz_files import SHIPPED as LOADERS

SHIPPED = {name: read_yaml(config_root() / name) for name in LOADERS}
MANY = settings(max_examples=2 * settings.default.max_examples)
ANYTHING = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["deg", "rpm", "1e400", "0x", "tm21", "../x", "2001-01-01"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner),
    max_leaves=6,
)


def check(load, path):
    """Either it loads, or the error is one line that names the file."""
    try:
        load(path)
    except CamRigError as error:
        assert "\n" not in str(error)
        assert path.name in str(error)


def paths_in(data, here=()):
    yield here
    items = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in items:
        if isinstance(value, (dict, list)):
            yield from paths_in(value, (*here, key))
        else:
            yield (*here, key)


@MANY
@given(st.data(), st.sampled_from([*LOADERS]))
def test_a_shipped_file_with_one_thing_changed(tmp_path, choice, name):
    """Any value anywhere, or a key too many or too few."""
    data = copy.deepcopy(SHIPPED[name])
    *above, last = choice.draw(st.sampled_from([p for p in paths_in(data) if p]))
    place = data
    for key in above:
        place = place[key]
    if choice.draw(st.booleans()):
        place[last] = choice.draw(ANYTHING)
    else:
        del place[last]
    path = tmp_path / name.split("/")[1]
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    check(LOADERS[name], path)


@given(text=st.text(max_size=30))
def test_a_scene_may_name_anything(tmp_path, text):
    """A cam's or rig's name cannot lead out of the folders."""
    path = tmp_path / "scenes" / "quick.yaml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(yaml.safe_dump(SHIPPED["scenes/quick.yaml"] | {"cams": [text]}), "utf-8")
    try:
        open_scene(path)
    except CamRigError as error:
        assert "\n" not in str(error)


def require_bounded(kind, cases, seed):
    """Each case is read or refused by one line, in 10 s of CPU, and all of them in 1 GB."""
    script = Path(__file__).with_name("fuzz_files.py")
    command = [sys.executable, str(script), kind, str(cases), str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=500)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["wrong"] == []
    assert found["refused"] > cases // 2  # else they are not hostile
    assert found["most_cpu_s"] < 10.0 and found["memory_mb"] < 1000.0


def test_hostile_files():
    """Too long, too deep, too many, of another kind, or a shipped one with something else in it."""
    require_bounded("yaml", 20, 1)


@pytest.mark.long
@pytest.mark.parametrize("seed", [2, 3, 4])
@pytest.mark.parametrize("kind", ["yaml", "csv"])
def test_many_hostile_files(kind, seed):
    require_bounded(kind, 400, seed)
