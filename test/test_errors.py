"""Errors as a user reads them."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from cam_rig.dynamics.parameters import row_of_numbers
from cam_rig.errors import BEGIN, END, CamRigError, ConfigError, DynamicsError


def test_a_message_of_thousands_of_numbers_keeps_its_begin_and_its_remedy() -> None:
    """Also of a copy, as from another process."""
    error = ConfigError(f"a: is {list(range(20_000))}; allowed: 3 numbers")
    for one in (error, copy.copy(error)):
        assert len(str(one)) < BEGIN + END + 10
        assert str(one).startswith("a: is [0, 1, 2, ")
        assert str(one).endswith("; allowed: 3 numbers")
    whole = "x" * (BEGIN + END)
    assert str(CamRigError(whole)) == whole


def test_so_does_what_the_core_says_of_an_argument() -> None:
    """A list that holds one wrong number among 20 000."""
    with pytest.raises(DynamicsError) as wrong:
        row_of_numbers("angles", ["x", *np.zeros(20_000).tolist()])
    assert len(str(wrong.value)) < BEGIN + END + 10
    assert str(wrong.value).endswith("allowed: a row of finite numbers")
