"""The drawings of the theory pages are those that their script draws today."""

from __future__ import annotations

import re

import matplotlib as mpl
import pytest

from tools.docs.drawings import DRAWINGS

from .pages import DOCS


def outline(path):
    """An SVG with its numbers rounded, so that the last digit of a machine does not count."""
    svg = path.read_text(encoding="utf-8")
    return re.sub(r"-?\d+\.\d+", lambda number: f"{float(number[0]):.1f}", svg)


@pytest.mark.parametrize("name", DRAWINGS)
def test_drawing_is_that_of_today(name, tmp_path):
    """Else run ``make docs``."""
    with mpl.rc_context({"svg.hashsalt": "cam_rig"}):
        DRAWINGS[name](tmp_path / name)
    assert outline(tmp_path / name) == outline(DOCS / name)
