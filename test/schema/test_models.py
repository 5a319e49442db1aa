"""Quantities, and the names of models in scenes, tables and panel texts."""

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
from cam_rig.cli.main import app
from cam_rig.dynamics import MODELS
from cam_rig.errors import ConfigError
from cam_rig.panel.bench import runner as setup
from cam_rig.schema import RigConfig, SceneConfig
from cam_rig.schema.load import Library, config_root, load_rig, load_scene
from cam_rig.schema.quantity import ORIGINS, UNITS, Quantity, must_be
from cam_rig.schema.rig import Radiation
from cam_rig.schema.scene import OLD_MODELS, Model, SpeedSchedule
from cam_rig.studies.campaign.campaign import campaign_from
from cam_rig.studies.fit_rig.study import MODELS as FITTED
from cam_rig.studies.orders.steady_force import BUILDERS


def test_a_quantity_has_an_origin_an_si_value_and_is_constant():
    """A quantity has the origin of its key, is converted to SI, and is immutable."""
    for origin in ORIGINS:
        quantity = Quantity.model_validate({origin: 2.5, "unit": "kg"})
        assert (quantity.origin, quantity.raw) == (origin, 2.5)
    lengths = ((50, "mm", 0.05), (1, "in", 0.0254))
    angles = ((180, "deg", math.pi), (0.5, "turn", math.pi), (60, "rpm", 2 * math.pi))
    others = ((4.03, "N/mm", 4030.0), (48, "kHz", 48_000.0), (1300, "g", 1.3))
    for number, unit, si in (*lengths, *angles, *others):
        assert Quantity(given=number, unit=unit).si == pytest.approx(si, rel=1e-15)
        several = Quantity(given=[number, 0], unit=unit).si_list
        assert several == pytest.approx([si, 0.0], rel=1e-15)
    with pytest.raises(ValidationError, match="frozen"):
        Quantity(given=1.0, unit="kg").given = 2.0


def test_every_unit_belongs_to_one_dimension():
    """Each unit belongs to one dimension, and another dimension is refused.

    Thus the unit determines the factor to SI.
    """
    names = [unit for units in UNITS.values() for unit in units]
    assert len(names) == len(set(names))
    for dimension, units in UNITS.items():
        check = TypeAdapter(Annotated[Quantity, must_be(dimension)])
        message = f"allowed: {re.escape(next(iter(units)))}"
        for unit in names:
            if unit in units:
                check.validate_python({"given": 1.0, "unit": unit})
            else:
                with pytest.raises(ValidationError, match=message):
                    check.validate_python({"given": 1.0, "unit": unit})


def test_limits_in_si_are_reported_in_the_unit_of_the_number():
    """A number beyond a limit is refused with the limit in the unit of the number.

    Each number of a list is checked.
    """
    for limits, inside, outside, message in (
        ({"gt": 0.0}, 1e-9, 0.0, "greater than 0 mm"),
        ({"ge": 0.001}, 1.0, 0.999, "at least 1 mm"),
        ({"le": 0.001}, 1.0, 1.001, "at most 1 mm"),
    ):
        check = TypeAdapter(Annotated[Quantity, must_be("length", **limits)])
        check.validate_python({"given": inside, "unit": "mm"})
        with pytest.raises(ValidationError, match=message):
            check.validate_python({"given": outside, "unit": "mm"})
    check = TypeAdapter(Annotated[Quantity, must_be("speed", counts=(1, 9), gt=0.0)])
    with pytest.raises(ValidationError, match="is -3 rpm; allowed: greater than 0 rpm"):
        check.validate_python({"given": [1, 2, -3], "unit": "rpm"})


# A model has the same name in every table, error and page. Old names are only read.

ROOT = Path(__file__).parents[2]
NAMES = set(get_args(get_args(Model)[0]))


def test_every_table_has_the_same_names_of_models(make_scene):
    """All tables, scenes and panel texts use the same names of models."""
    assert set(MODELS) == set(setup.MODELS) == NAMES
    assert set(SAMPLED) | set(BUILDERS) | set(FITTED) <= NAMES
    for page in sorted((ROOT / "cam_rig/panel/static/texts").glob("*.json")):
        keys = json.loads(page.read_text(encoding="utf-8"))
        assert {key[6:] for key in keys if key.startswith("model_")} == NAMES
    assert set(OLD_MODELS.values()) < NAMES and not set(OLD_MODELS) & NAMES
    assert {make_scene(model=name).model for name in NAMES} == NAMES


@pytest.mark.parametrize(("old", "new"), OLD_MODELS.items())
def test_an_old_name_is_read_and_the_new_one_written(make_loaded_scene, old, new):
    """An old name of a model is accepted, and all outputs have the new name.

    This applies to a scene, a study, an argument and an option.
    """
    scene = make_loaded_scene(model=old).scene
    assert scene.model == json.loads(scene.model_dump_json())["model"] == new
    study = yaml.safe_load((config_root() / "campaigns/tolerance_poly345.yaml").read_text())
    study["base"] = {"cam": "poly345", "rig": "paper_table2", "model": old}
    assert campaign_from(study, Library((config_root(),))).config.base.model == new
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    rig = cam_rig.load_rig("paper_table2")
    motion = cam_rig.simulate(law, rig, model=old, rpm=300, turns=1, sample_rate=1000)
    assert motion.scene.model == new
    words = ["orders", "poly345", "--rig", "paper_table2", "--rpm", "300:300:1", "--model", old]
    done = CliRunner().invoke(app, [*words, "--json", "-"])
    assert done.exit_code == 0, done.output
    for text in (repr(motion), done.output):
        assert new in text and old not in text


def test_a_fit_accepts_an_old_name_and_rejects_an_unknown_name():
    """`fit rig` accepts an old name of a model and refuses an unknown one."""
    for name, message in (("separation", "no such file"), ("two", "must be one_mass or two_mass")):
        done = CliRunner().invoke(app, ["fit", "rig", "none.csv", "tm21", "--model", name])
        assert done.exit_code == 2 and message in " ".join(done.output.replace("│", " ").split())


def test_keys_of_earlier_versions_are_read(tmp_path):
    """A scene and a rig with keys of an earlier version equal those with present keys."""
    root = config_root()
    for path, load, model in (
        (root / "scenes" / "bounce.yaml", load_scene, SceneConfig),
        (root / "rigs" / "tm21.yaml", load_rig, RigConfig),
    ):
        earlier = path.read_text(encoding="utf-8")
        kinds = [model, Radiation if model is RigConfig else SpeedSchedule]
        names = {new: old for kind in kinds for old, new in kind.earlier_keys.items()}
        for new, old in names.items():
            earlier, count = re.subn(rf"(?m)^(\s*){new}:", rf"\1{old}:", earlier)
            assert count == 1
        file = tmp_path / path.name
        file.write_text(earlier, encoding="utf-8")
        assert load(file) == load(path)


def test_an_earlier_and_a_present_key_together_are_an_error(tmp_path):
    """A file with an earlier key and its present key is refused.

    Neither of two values is ignored.
    """
    text = (config_root() / "scenes" / "quick.yaml").read_text(encoding="utf-8")
    file = tmp_path / "two.yaml"
    file.write_text(f"{text}program: {{}}\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="program: unknown key"):
        load_scene(file)
