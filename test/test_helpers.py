"""What the tests themselves lean on: stored references, domains of their own."""

import json

import numpy as np
import pytest

from cam_rig.testing.running_rig import hold_domain

from .references import References


def test_a_reference_is_of_its_numbers_alone(tmp_path):
    """Stored and read back to the last bit; other inputs, other values and a missing one fail."""
    path, values = tmp_path / "references" / "a.json", [np.pi, 1e-300]
    assert References("write", path, "t")(lambda: values, [3.0, [1e8, 1e-3]]).tolist() == values
    assert References("stored", path, "t")(pytest.fail, [3.0, [1e8, 1e-3]]).tolist() == values
    with pytest.raises(AssertionError, match="is of other numbers; run `make references`"):
        References("stored", path, "t")(pytest.fail, [3.0, [1e8, 1.0001e-3]])
    with pytest.raises(AssertionError, match="has no u:0"):
        References("stored", path, "u")(pytest.fail, [3.0])
    found = References("compute", path, "t")(lambda: values, [3.0, [1e8, 1e-3]])
    assert found.tolist() == values
    with pytest.raises(AssertionError, match="run `make references`"):
        References("compute", path, "t")(lambda: [3.1415926535897, 0.0], [3.0, [1e8, 1e-3]])
    assert list(json.loads(path.read_text(encoding="utf-8"))) == ["t:0"]


def test_no_two_hold_one_domain():
    """Whoever asks while one is held gets another."""
    with hold_domain() as one, hold_domain() as two:
        assert one != two
        assert {one, two} <= set(range(40, 101))
