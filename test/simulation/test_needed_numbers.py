"""A rig file needs what the model and the measure in use need, and nothing else."""

import re
from pathlib import Path

import pytest

import cam_rig
from cam_rig.dynamics import MODELS
from cam_rig.errors import ConfigError
from cam_rig.schema import RigConfig

FOUR = {"mass": "kg", "spring_stiffness": "N/m", "damping": "N*s/m", "preload": "N"}
VALUES = {"mass": 2.0, "spring_stiffness": 5000.0, "damping": 10.0, "preload": 60.0}
OPTIONAL = {
    "stem_stiffness": (1e6, "N/m"),
    "restitution": (0.3, "1"),
    "roller_share": (0.4, "1"),
    "stem_damping": (20.0, "N*s/m"),
}


def needs() -> dict[str, list[str]]:
    """What each model needs beside the four numbers, as docs/files.md says it."""
    text = (Path(__file__).parents[2] / "docs" / "files.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| model `(\w+)` \| (.*) \|$", text, re.M)
    return {model: re.findall(r"`(\w+)`", keys) for model, keys in rows}


NEEDS = needs()


def rig_of(keys, shipped="tm21") -> RigConfig:
    """A rig with the four numbers and these keys alone; sections as a shipped rig has them."""
    data = {"name": "mine", "title": "mine"}
    data["follower"] = {key: {"given": VALUES[key], "unit": unit} for key, unit in FOUR.items()}
    for key in keys:
        if key in OPTIONAL:
            value, unit = OPTIONAL[key]
            data["follower"][key] = {"given": value, "unit": unit}
        else:
            rig = cam_rig.load_rig("paper_flywheel" if key == "shaft" else shipped)
            data[key] = rig.model_dump(exclude_none=True)[key]
    return RigConfig.model_validate(data)


def test_the_table_names_every_model():
    """The documentation says for each model what it needs."""
    assert set(NEEDS) == set(MODELS)


def turned(model, keys):
    """A turn of a model on a rig with these keys alone."""
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    return cam_rig.simulate(law, rig_of(keys), rpm=200, model=model, turns=3)


@pytest.mark.parametrize("model", MODELS)
def test_a_model_asks_for_what_it_needs_and_no_more(model):
    """It turns with exactly its keys; each one fewer is named in one line, with what needs it."""
    assert turned(model, NEEDS[model]).force.size
    for missing in NEEDS[model]:
        with pytest.raises(ConfigError) as refused:
            turned(model, [key for key in NEEDS[model] if key != missing])
        words = str(refused.value)
        assert re.match(rf"rig mine: (follower\.)?{missing}: is missing; needed by ", words)
        assert "so add it" in words and "\n" not in words


@pytest.mark.parametrize("model", MODELS)
def test_a_level_asks_for_the_sound(model):
    """It needs ``radiation``, and the stem where a landing sounds, whatever the model else asks."""
    own = [*NEEDS[model], "radiation"]
    lands = MODELS[model].lifts_off
    keys = [*own, "stem_stiffness"] if lands and "stem_stiffness" not in own else own
    full = sorted({*own, "stem_stiffness"})
    level = cam_rig.sound_level(turned(model, keys)).level_db
    assert level == cam_rig.sound_level(turned(model, full)).level_db
    for missing in ("radiation", "stem_stiffness") if lands else ("radiation",):
        motion = turned(model, keys)
        left = rig_of([key for key in keys if key != missing])
        motion = type(motion)(**{**vars(motion), "rig": left})
        with pytest.raises(ConfigError, match=f"rig mine: .*{missing}: is missing; needed by the "):
            cam_rig.sound_level(motion)
