"""The names of follower models in a scene's file."""

import json

import pytest

from cam_rig.dynamics import MODELS
from cam_rig.schema.scene import MODEL_ALIASES


def test_every_model_can_be_named(make_scene):
    """By its own key and by its other names; there are no others."""
    for key in MODELS:
        assert make_scene(model=key).model == key
    assert set(MODEL_ALIASES.values()) <= set(MODELS)
    assert not MODEL_ALIASES.keys() & MODELS.keys()


@pytest.mark.parametrize(("alias", "key"), MODEL_ALIASES.items())
def test_the_key_is_what_is_written(make_loaded_scene, alias, key):
    """A file may have the other name; whatever is written of the scene has the key."""
    scene = make_loaded_scene(model=alias).scene
    assert scene.model == key
    assert json.loads(scene.model_dump_json())["model"] == key
