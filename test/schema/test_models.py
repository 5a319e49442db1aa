"""A model has one name, in every table, error and page; an older one is read alone."""

import json
import re
from pathlib import Path
from typing import get_args

import pytest
import yaml
from typer.testing import CliRunner

import cam_rig
from benchmark.speed.cases import SAMPLED
from cam_rig.campaigns.campaign import campaign_from
from cam_rig.cli.main import app
from cam_rig.dynamics import MODELS
from cam_rig.measured.rig_fit.command import FollowerModel
from cam_rig.panel.bench import runner as setup
from cam_rig.paper.orders.steady_force import BUILDERS
from cam_rig.schema.load import Library, config_root
from cam_rig.schema.scene import OLD_MODELS, Model

ROOT = Path(__file__).parents[2]
NAMES = set(get_args(get_args(Model)[0]))
#: An older name where a model is meant; the words mean other things too.
OLD = re.compile(r"(model:? +`?|one_mass.{1,9})(separation|residual)\b|`separation`|`residual`[,)]")


def texts():
    """Pages and files that are shipped."""
    for folder, ending in (("docs", "md"), ("config", "yaml"), ("examples", "*"), ("launch", "py")):
        yield from sorted((ROOT / folder).rglob(f"*.{ending}"))


def test_every_table_has_the_same_names():
    """What a scene may say is what there is; other tables take some of it."""
    assert set(MODELS) == set(setup.MODELS) == NAMES
    assert set(SAMPLED) | set(BUILDERS) | {one.value for one in FollowerModel} <= NAMES
    for page in sorted((ROOT / "cam_rig/panel/static/texts").glob("*.json")):
        keys = json.loads(page.read_text(encoding="utf-8"))
        assert {key[6:] for key in keys if key.startswith("model_")} == NAMES
    assert set(OLD_MODELS.values()) < NAMES
    assert not set(OLD_MODELS) & NAMES


def test_every_model_can_be_named(make_scene):
    """In a scene, by its one name."""
    for name in NAMES:
        assert make_scene(model=name).model == name


@pytest.mark.parametrize(("old", "new"), OLD_MODELS.items())
def test_the_new_name_is_what_is_written(make_loaded_scene, old, new):
    """A file may have the older name; whatever is written of the scene has the other."""
    scene = make_loaded_scene(model=old).scene
    assert scene.model == new
    assert json.loads(scene.model_dump_json())["model"] == new


@pytest.mark.parametrize(("old", "new"), OLD_MODELS.items())
def test_an_old_name_is_read(old, new):
    """In a study, an argument and an option; what comes of it has the new one."""
    study = yaml.safe_load((config_root() / "campaigns/tolerance_poly345.yaml").read_text())
    study["base"] = {"cam": "poly345", "rig": "paper_table2", "model": old}
    assert campaign_from(study, Library((config_root(),))).config.base.model == new
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    rig = cam_rig.load_rig("paper_table2")
    motion = cam_rig.simulate(law, rig, model=old, rpm=300, turns=1, sample_rate=1000)
    assert motion.scene.model == new
    assert new in repr(motion)
    assert old not in repr(motion)
    words = ["orders", "poly345", "--rig", "paper_table2", "--rpm", "300:300:1", "--model", old]
    done = CliRunner().invoke(app, [*words, "--json", "-"])
    assert done.exit_code == 0, done.output
    assert f'"{new}"' in done.output
    assert f'"{old}"' not in done.output


def test_a_fit_reads_an_old_name_and_refuses_another():
    """The option's own words name what it takes."""
    for name, words in (("separation", "no such file"), ("two", "allowed: one_mass or two_mass")):
        done = CliRunner().invoke(app, ["fit", "rig", "none.csv", "tm21", "--model", name])
        assert done.exit_code == 2
        assert words in " ".join(done.output.replace("│", " ").split())


def test_no_text_has_an_old_name():
    """Errors, help, pages, shipped files."""
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    with pytest.raises(cam_rig.CamRigError) as unknown:
        cam_rig.simulate(law, cam_rig.load_rig("tm21"), model="rigid", rpm=300)
    with pytest.raises(cam_rig.CamRigError) as lacking:
        cam_rig.simulate(law, cam_rig.load_rig("tm21"), model="two_mass", rpm=300)
    for error in (unknown, lacking):
        assert not re.search("|".join(OLD_MODELS), str(error.value))
    for path in texts():
        found = OLD.search(path.read_text(encoding="utf-8"))
        assert found is None, f"{path}: {found}"
