"""How a run is to be shown; apart from what draws it, whose imports take a second."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Layout(StrEnum):
    """A run as it goes, cams side by side at one speed, or what a report needs."""

    RUN = "run"
    COMPARE = "compare"
    REPORT = "report"


@dataclass(frozen=True)
class ViewOptions:
    """How a recording is laid out and thinned.

    Parameters
    ----------
    layout : the run itself, cams side by side, or a report
    rpm : the speed at which cams are compared; by default the scene's highest
    all_samples : keep every sample, however many
    """

    layout: Layout = Layout.RUN
    rpm: float | None = None
    all_samples: bool = False
