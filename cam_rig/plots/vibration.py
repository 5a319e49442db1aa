"""Residual and torsional vibration of several cams, as in figs. 4-6 and 9 of the paper."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.plots.figures import CAM_ANGLE, empty, line, turn_axis, write
from cam_rig.studies.cam_set import CamSet
from cam_rig.studies.vibration.dwell import LowDwell, low_dwell
from cam_rig.studies.vibration.steady_state import SteadyTurn, steady_turn, steady_twist
from cam_rig.units import RPM


def draw(cam_set: CamSet, rpm: float, path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    write(figure(cam_set, rpm), path)


def figure(cam_set: CamSet, rpm: float) -> Figure:
    """Displacement, residual vibration, acceleration and twist in steady state at a speed (rpm)."""
    out = empty(11.0, 7.4)
    panels = out.subplots(2, 2)
    follower = FollowerParameters.from_rig(cam_set.rig)
    for cam, law in cam_set.laws.items():
        turn, title = steady_turn(law, follower, rpm * RPM), cam_set.titles[cam]
        degrees = np.degrees(turn.angle)
        panels[0, 0].plot(degrees, 1e3 * turn.displacement, lw=1.5, label=title, **line(cam))
        _residual(panels[0, 1], turn, low_dwell(law), cam)
        panels[1, 0].plot(degrees, turn.acceleration, lw=1.2, **line(cam))
        if cam_set.rig.shaft is not None:
            angle, twist = steady_twist(law, shaft_of(cam_set.rig), rpm * RPM)
            panels[1, 1].plot(np.degrees(angle), np.degrees(twist), lw=1.2, **line(cam))
    _label(panels, cam_set, rpm)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    out.legend(
        handles, labels, loc="outside lower center", ncols=5, frameon=False, handlelength=3.4
    )
    return out


def _residual(axes: Axes, turn: SteadyTurn, window: LowDwell, cam: str) -> None:
    """About the low dwell: what is left of the vibration there."""
    degrees = (np.degrees(turn.angle - window.middle) + 180.0) % 360.0 - 180.0
    order = np.argsort(degrees)
    inside = order[np.abs(degrees[order]) <= 60.0]
    style = line(cam) if window.dwell else line(cam) | {"alpha": 0.9}
    axes.plot(degrees[inside], 1e6 * turn.vibration[inside], lw=1.2, **style)


def _label(panels: np.ndarray, cam_set: CamSet, rpm: float) -> None:
    laws = cam_set.laws.values()
    titles = (
        ("Displacement (fig. 4)", "displacement x [mm]"),
        ("Residual vibration about the low dwell (fig. 5)", "x − quasi-static displacement [µm]"),
        ("Acceleration (fig. 6)", "acceleration ẍ [m/s²]"),
        ("Torsional vibration (fig. 9)", "twist, cam − flywheel [°]"),
    )
    for axes, (title, label) in zip(panels.flat, titles, strict=True):
        axes.set(title=title, xlabel=CAM_ANGLE, ylabel=label)
        axes.grid(alpha=0.25)
        if "low dwell" in title:
            axes.set(xlim=(-60.0, 60.0), xticks=range(-60, 61, 20))
            axes.set(xlabel="cam angle from the middle of the low dwell [°]")
            for half in {round(0.5 * np.degrees(low_dwell(law).span), 9) for law in laws}:
                axes.axvspan(-half, half, color="0.5", alpha=0.10, lw=0)
        else:
            turn_axis(axes)
    if cam_set.rig.shaft is None:
        panels[1, 1].text(
            0.5, 0.5, "this rig has no shaft", ha="center", transform=panels[1, 1].transAxes
        )
    panels[0, 0].figure.suptitle(f"Steady state at {rpm:g} rpm on {cam_set.rig.name}")
