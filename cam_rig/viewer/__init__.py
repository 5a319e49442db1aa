"""Display of a run in the Rerun viewer, from a bag or live, and its web server."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

# The options are defined here, not in the modules that draw, because importing those takes a
# second.


class Layout(StrEnum):
    """Layout of a recording: a run, cams side by side at one speed, or a report."""

    RUN = "run"
    COMPARE = "compare"
    REPORT = "report"


class Tab(StrEnum):
    """Tabs of the layout of a run that every recorded run has, by their titles."""

    TURN = "One turn"
    SOUND = "Sound"
    CONTACT = "Contact and flight"
    ROBOT = "Rig in 3D"
    RESULTS = "Results"


@dataclass(frozen=True)
class ViewOptions:
    """Options of a Rerun recording.

    Parameters
    ----------
    layout : Layout
        Layout of the views.
    rpm : float, optional
        Speed in rpm at which cams are compared (default: the highest speed of the run).
    decimate : bool
        True if the samples of a long run are reduced to the minimum and the maximum of each
        bucket, a group of successive samples. False keeps every sample.
    tab : Tab
        Tab that is open at first in the layout of a run.
    """

    layout: Layout = Layout.RUN
    rpm: float | None = None
    decimate: bool = True
    tab: Tab = Tab.TURN
