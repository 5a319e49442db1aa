"""Quantities and names of models: one origin, one unit, one name in every table."""

import json
import math
import re
from pathlib import Path
from typing import Annotated, get_args

import pytest
import yaml
from pydantic import TypeAdapter, ValidationError
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
from cam_rig.schema.quantity import ORIGINS, UNITS, Quantity, must_be
from cam_rig.schema.scene import OLD_MODELS, Model

ALL_UNITS = [(d, unit) for d, units in UNITS.items() for unit in units]


def test_origin_is_kept():
    for origin in ORIGINS:
        quantity = Quantity.model_validate({origin: 2.5, "unit": "kg"})
        assert quantity.origin == origin
        assert quantity.raw == 2.5


def test_si():
    for number, unit, si in [
        (50, "mm", 0.05),
        (1, "in", 0.0254),
        (180, "deg", math.pi),
        (0.5, "turn", math.pi),
        (60, "rpm", 2 * math.pi),
        (4.03, "N/mm", 4030.0),
        (48, "kHz", 48_000.0),
        (1300, "g", 1.3),
    ]:
        assert Quantity(given=number, unit=unit).si == pytest.approx(si, rel=1e-15)
        assert Quantity(given=[number, 0], unit=unit).si_list == pytest.approx([si, 0.0], rel=1e-15)


def test_every_unit_fits_its_dimension_alone():
    for dimension, unit in ALL_UNITS:
        for other, units in UNITS.items():
            check = TypeAdapter(Annotated[Quantity, must_be(other)])
            if other == dimension:
                check.validate_python({"given": 1.0, "unit": unit})
            else:
                with pytest.raises(
                    ValidationError, match=re.escape(f"allowed: {next(iter(units))}")
                ):
                    check.validate_python({"given": 1.0, "unit": unit})


def test_units_are_unambiguous():
    names = [unit for _, unit in ALL_UNITS]
    assert len(names) == len(set(names))


def test_limits():
    for limits, inside, outside, words in [
        ({"above": 0.0}, 1e-9, 0.0, "greater than 0 mm"),
        ({"least": 0.001}, 1.0, 0.999, "at least 1 mm"),
        ({"most": 0.001}, 1.0, 1.001, "at most 1 mm"),
    ]:
        check = TypeAdapter(Annotated[Quantity, must_be("length", **limits)])
        check.validate_python({"given": inside, "unit": "mm"})
        with pytest.raises(ValidationError, match=words):
            check.validate_python({"given": outside, "unit": "mm"})


def test_each_number_of_a_list_is_checked():
    check = TypeAdapter(Annotated[Quantity, must_be("speed", many=True, above=0.0)])
    with pytest.raises(ValidationError, match="is -3 rpm; allowed: greater than 0 rpm"):
        check.validate_python({"given": [1, 2, -3], "unit": "rpm"})


def test_immutable():
    with pytest.raises(ValidationError, match="frozen"):
        Quantity(given=1.0, unit="kg").given = 2.0


ROOT = Path(__file__).parents[2]
NAMES = set(get_args(get_args(Model)[0]))
#: An older name where a model is meant; the words mean other things too.
OLD = re.compile(r"(model:? +`?|one_mass.{1,9})(separation|residual)\b|`separation`|`residual`[,)]")


def texts():
    """Pages and files that are shipped."""
    for folder, ending in (("docs", "md"), ("config", "yaml"), ("examples", "*"), ("launch", "py")):
        yield from sorted((ROOT / folder).rglob(f"*.{ending}"))


def test_every_table_has_the_same_names():
    assert set(MODELS) == set(setup.MODELS) == NAMES
    assert set(SAMPLED) | set(BUILDERS) | {one.value for one in FollowerModel} <= NAMES
    for page in sorted((ROOT / "cam_rig/panel/static/texts").glob("*.json")):
        keys = json.loads(page.read_text(encoding="utf-8"))
        assert {key[6:] for key in keys if key.startswith("model_")} == NAMES
    assert set(OLD_MODELS.values()) < NAMES
    assert not set(OLD_MODELS) & NAMES


def test_every_model_can_be_named(make_scene):
    for name in NAMES:
        assert make_scene(model=name).model == name


@pytest.mark.parametrize(("old", "new"), OLD_MODELS.items())
def test_the_new_name_is_what_is_written(make_loaded_scene, old, new):
    scene = make_loaded_scene(model=old).scene
    assert scene.model == new
    assert json.loads(scene.model_dump_json())["model"] == new


@pytest.mark.parametrize(("old", "new"), OLD_MODELS.items())
def test_an_old_name_is_read(old, new):
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
    for name, words in (("separation", "no such file"), ("two", "allowed: one_mass or two_mass")):
        done = CliRunner().invoke(app, ["fit", "rig", "none.csv", "tm21", "--model", name])
        assert done.exit_code == 2
        assert words in " ".join(done.output.replace("│", " ").split())


def test_no_text_has_an_old_name():
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
