"""A number that was found, as tables and files have it."""

import re

import pytest
import yaml

from cam_rig.measured.rig_fit.result import FoundNumber
from cam_rig.measured.rig_fit.rig_fit import fitted_rig
from cam_rig.measured.rig_fit.tables import gist, numbers_json, numbers_table

SURE = FoundNumber("preload", 14.947876, 0.0323, "identified")
UNSURE = FoundNumber("damping", 8.6234, 3.1, "identified")
OPEN = FoundNumber("restitution", 0.04123, 0.03, "identified")
NONE = FoundNumber.unidentified("stem_stiffness", "a rigid stem explains it", 1e7)


def test_a_number_has_the_digits_of_its_error():
    """In the table, and in the file with the error beside it."""
    rows = {row[0]: row for row in numbers_table([SURE, UNSURE, OPEN, NONE], "rig").rows}
    assert rows["preload"][1:3] == ("14.948", "0.032")
    assert rows["damping"][1:3] == ("8.6", "3.1")
    assert gist(SURE) == "14.948 ± 0.032 N"


@pytest.mark.parametrize(("number", "words"), [(UNSURE, "uncertain"), (OPEN, "may be 0")])
def test_a_wide_error_is_warned_of_beside_the_value(number, words):
    """A third of the value or more, or its sign open: in the row, in the file, in JSON."""
    (row,) = numbers_table([number], "rig").rows
    assert re.match(rf"identified; {words}: with 95 % it is", row[-1])
    assert words in gist(number)
    assert words in numbers_json([number])[number.name]["caution"]
    assert SURE.caution == ""


def test_a_number_without_a_value_is_not_identified():
    """Neither in the table nor in JSON; a rig file has another rig's, assumed."""
    (row,) = numbers_table([NONE], "rig").rows
    assert row == ("stem_stiffness", "N/m", "not identified")
    assert numbers_json([NONE])["stem_stiffness"]["origin"] == "not identified"


def test_a_rig_file_has_the_digits_of_the_error(rig):
    """14.948, and 14.948 ± 0.032 N beside it."""
    text, _ = fitted_rig("bench", [SURE, NONE], rig, "cam-rig fit rig a.csv", "1 rpm a reading")
    follower = yaml.safe_load(text)["follower"]
    assert follower["preload"]["identified"] == 14.948
    assert "14.948 ± 0.032 N" in follower["preload"]["residual"]
    assert "assumed" in follower["stem_stiffness"]
