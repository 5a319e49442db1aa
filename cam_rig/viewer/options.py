"""How a run is to be shown. Apart from all that draws, whose imports take a second."""

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
    """How a picture is wanted.

    Parameters
    ----------
    layout : for running, for comparing cams, or for a report
    rpm : the speed at which cams are compared; by default the scene's highest
    all_samples : keep every sample, however many
    """

    layout: Layout = Layout.RUN
    rpm: float | None = None
    all_samples: bool = False
