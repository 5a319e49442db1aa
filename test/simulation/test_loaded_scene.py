"""A scene and every file it names, checked before anything starts."""

import pytest

from cam_rig.errors import CamRigError, ConfigError, LawError
from cam_rig.simulation.scene import open_scene


def test_shipped_scenes_open(config_dir):
    """Each shipped scene finds every file it names."""
    paths = sorted((config_dir / "scenes").glob("*.yaml"))
    assert paths
    for path in paths:
        loaded = open_scene(path)
        assert list(loaded.laws) == loaded.scene.cams
        assert all(file.is_file() for file in loaded.files)


@pytest.mark.parametrize(
    ("changes", "file"),
    [
        ({"cams": ["no_such_cam"]}, "no_such_cam.yaml"),
        ({"rig": "no_such_rig"}, "no_such_rig.yaml"),
        ({"published": "no_such_paper"}, "no_such_paper.yaml"),
    ],
)
def test_missing_part(make_loaded_scene, changes, file):
    """A name without a file is an error that names the file it stands for."""
    with pytest.raises(ConfigError, match=file) as caught:
        make_loaded_scene(**changes)
    assert caught.value.exit_code == 2
    assert "\n" not in str(caught.value)


def own_cam(tmp_path, config_dir, name, old, new):
    """A cam beside the scene, made from the shipped 3-4-5."""
    text = (config_dir / "cams" / "poly345.yaml").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "cams" / f"{name}.yaml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


def test_name_differs_from_file(make_loaded_scene, tmp_path, config_dir):
    """A cam file must have its own name inside: results are told apart by it."""
    own_cam(tmp_path, config_dir, "mine", "name: poly345", "name: yours")
    with pytest.raises(ConfigError, match=r"mine\.yaml: name is 'yours'; allowed: .*'mine'"):
        make_loaded_scene(cams=["mine"])


def test_level_step_names_the_file(make_loaded_scene, tmp_path, config_dir):
    """A cam whose segments do not join is refused in one line that names its file."""
    path = own_cam(
        tmp_path,
        config_dir,
        "poly345",
        "{law: poly345, to: 0, span: {identified: 117.5, unit: deg",
        '{law: bezier, ordinates: {assumed: [0.5, 0, 0], unit: "1"}, '
        "span: {identified: 117.5, unit: deg",
    )
    with pytest.raises(LawError) as caught:
        make_loaded_scene(cams=["poly345"])
    assert caught.value.exit_code == 2
    message = str(caught.value)
    assert "segments[3]" in message
    assert "steps by -0.5 of the lift" in message
    assert "allowed: " in message
    assert "\n" not in message
    assert str(path) in message


def test_roles(make_loaded_scene):
    """A cam's comparison is worth what its numbers were fitted to."""
    loaded = make_loaded_scene(cams=["poly345", "bezier15", "tm21"])
    roles = {cam: loaded.role(cam) for cam in loaded.scene.cams}
    assert roles == {"poly345": "calibrated", "bezier15": "predicted", "tm21": "identified"}


def test_only_one_cam(make_loaded_scene, laws):
    """The same scene with one cam, and another law in its place."""
    trial = make_loaded_scene().only("bezier15", laws["poly4567"])
    assert trial.scene.cams == ["bezier15"]
    assert trial.laws == {"bezier15": laws["poly4567"]}


def test_all_errors_share_one_root():
    """A command has one type to catch."""
    assert issubclass(ConfigError, CamRigError)
    assert issubclass(LawError, CamRigError)


@pytest.mark.parametrize(
    "cam", ["constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate"]
)
def test_a_follower_that_the_models_do_not_know(make_loaded_scene, cam):
    """No second contact in the dynamics: refused by the cam file and the key."""
    words = rf"{cam}\.yaml: follower\.type is '{cam}'; allowed on a rig: one that a closing spring"
    with pytest.raises(ConfigError, match=words):
        make_loaded_scene(cams=[cam])


def test_faces_arms_and_eccentric_rollers_are_known(make_loaded_scene):
    """They move against the closing spring like any other."""
    cams = ["flat", "inclined_flat", "eccentric_roller", "oscillating_roller", "oscillating_flat"]
    assert list(make_loaded_scene(cams=cams).laws) == cams


def test_a_table_brings_its_points(make_loaded_scene, tmp_path):
    """The file of points is one of the scene's files: a bag holds it, and can be analysed alone."""
    from cam_rig.bag.reader import read_scene
    from cam_rig.bag.writer import BagWriter

    loaded = make_loaded_scene(cams=["measured"], published=None)
    assert "measured.csv" in [path.name for path in loaded.files]
    writer = BagWriter(tmp_path / "bag")
    for path in loaded.files:
        writer.attach(f"{path.parent.name}/{path.name}", path.read_bytes())
    writer.close()
    again = read_scene(tmp_path / "bag")
    assert again.cams["measured"] == loaded.cams["measured"]
