"""The list of laws is what a cam file may name, no more and no less."""

from typing import get_args

from cam_rig.laws.catalogue import free_laws
from cam_rig.laws.segments import BUILDERS, NAMED_RISES
from cam_rig.schema.segments import Rise, Segment


def test_every_law_of_a_file_is_listed():
    """Schema, list and builders name the same laws."""
    models = get_args(get_args(Segment)[0])
    tags = {tag for model in models for tag in get_args(model.model_fields["law"].annotation)}
    free = set(free_laws())
    assert tags == free | set(NAMED_RISES)
    assert free - {"dwell"} == set(BUILDERS)
    assert set(get_args(Rise.model_fields["law"].annotation)) == set(NAMED_RISES)
