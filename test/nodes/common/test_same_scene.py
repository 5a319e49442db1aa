"""Every node has the drive's scene, or the run does not begin."""

import pytest

from cam_rig.errors import ConfigError
from cam_rig.nodes.rig_node import require_one_scene, scene_mark

pytestmark = pytest.mark.ros


@pytest.fixture
def scene(tmp_path):
    """Write a scene's file."""

    def scene(name, text):
        (tmp_path / text).mkdir(exist_ok=True)
        path = tmp_path / text / f"{name}.yaml"
        path.write_text(text, encoding="utf-8")
        return str(path)

    return scene


def test_copies_of_a_scene_are_one(scene, tmp_path):
    """The file counts, not the folder it lies in."""
    one = scene("one", "a")
    copy = tmp_path / "copy"
    copy.mkdir()
    (copy / "one.yaml").write_text("a", encoding="utf-8")
    require_one_scene("follower", scene_mark(one), str(copy / "one.yaml"))


@pytest.mark.parametrize(("theirs", "words"), [("two", "has two"), ("one", "has another file of")])
def test_another_scene_is_refused(scene, theirs, words):
    """By name, or by what the file holds."""
    with pytest.raises(ConfigError, match=words):
        require_one_scene("follower", scene_mark(scene(theirs, "b")), scene("one", "a"))


def test_a_node_without_a_scene_is_taken(scene):
    """The player's consumers have the bag's own; a file may be gone since it was read."""
    require_one_scene("viewer", "", scene("one", "a"))
    require_one_scene("follower", "one#00000000", "")
    assert scene_mark("/nowhere/one.yaml") == ""
