"""Every YAML file loads as a valid config, or raises an error of one line."""

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
    """Check that a file loads, or raises an error of one line that names the file."""
    try:
        load(path)
    except CamRigError as error:
        assert "\n" not in str(error)
        assert path.name in str(error)


def paths_in(data, prefix=()):
    """Yield the path of each value in nested data."""
    yield prefix
    items = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in items:
        if isinstance(value, (dict, list)):
            yield from paths_in(value, (*prefix, key))
        else:
            yield (*prefix, key)


@MANY
@given(st.data(), st.sampled_from([*LOADERS]))
def test_a_shipped_file_with_one_changed_or_missing_value(tmp_path, choice, name):
    """A shipped file with one changed or missing value loads, or raises one line.

    The line names the file.
    """
    data = copy.deepcopy(SHIPPED[name])
    *parents, last = choice.draw(st.sampled_from([p for p in paths_in(data) if p]))
    node = data
    for key in parents:
        node = node[key]
    if choice.draw(st.booleans()):
        node[last] = choice.draw(ANYTHING)
    else:
        del node[last]
    path = tmp_path / name.split("/")[1]
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    check(LOADERS[name], path)


@given(text=st.text(max_size=30))
def test_any_text_as_the_name_of_a_cam(tmp_path, text):
    """A scene with any text as the name of its cam loads, or raises one line."""
    path = tmp_path / "scenes" / "quick.yaml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(yaml.safe_dump(SHIPPED["scenes/quick.yaml"] | {"cams": [text]}), "utf-8")
    try:
        open_scene(path)
    except CamRigError as error:
        assert "\n" not in str(error)


def require_bounded(kind, cases, seed):
    """Check that each case loads or raises an error of one line.

    A case may take 10 s of CPU time, and all cases 1 GB of memory.
    """
    script = Path(__file__).with_name("fuzz_files.py")
    command = [sys.executable, str(script), kind, str(cases), str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=500)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["failures"] == []
    assert result["errors"] > cases // 2  # otherwise the cases are not hostile
    assert result["max_cpu_s"] < 10.0 and result["memory_mb"] < 1000.0


def test_hostile_files_load_or_raise_an_error_of_one_line():
    """Each of 20 hostile YAML files loads or raises one line.

    Time and memory are bounded.
    """
    require_bounded("yaml", 20, 1)


@pytest.mark.long
@pytest.mark.parametrize("seed", [2, 3, 4])
@pytest.mark.parametrize("kind", ["yaml", "csv"])
def test_many_hostile_files_load_or_raise_an_error_of_one_line(kind, seed):
    """Each of 400 hostile YAML or CSV files loads or raises one line.

    Time and memory are bounded.
    """
    require_bounded(kind, 400, seed)
