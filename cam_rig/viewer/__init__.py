"""A run in the Rerun viewer, from a bag or live, and the web server of the pages."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

# Apart from what draws it, whose imports take a second.


class Layout(StrEnum):
    """A run as it goes, cams side by side at one speed, or what a report needs."""

    RUN = "run"
    COMPARE = "compare"
    REPORT = "report"


@dataclass(frozen=True)
class ViewOptions:
    """How a recording is laid out and thinned; cams are compared at ``rpm``, else the highest."""

    layout: Layout = Layout.RUN
    rpm: float | None = None
    all_samples: bool = False
