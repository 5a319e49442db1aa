"""What a picture is for."""

from __future__ import annotations

from enum import StrEnum


class Layout(StrEnum):
    """A run as it goes, cams side by side at one speed, or what a report needs."""

    RUN = "run"
    COMPARE = "compare"
    REPORT = "report"
