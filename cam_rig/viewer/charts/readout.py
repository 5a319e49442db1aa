"""Numbers under the picture of cam and follower, as an instrument shows them."""

from __future__ import annotations

import math

import numpy as np
import rerun as rr

from cam_rig.arrays import FloatArray
from cam_rig.drawing.words import four_digits
from cam_rig.units import TURN


def readings(
    angle: FloatArray,
    rpm: float,
    lift: FloatArray,
    force: FloatArray,
    gap: FloatArray,
    pressure_angle: FloatArray,
    max_lift: float = math.inf,
) -> list[str]:
    """Markdown of each of many frames; arrays ``(n,)``.

    Parameters
    ----------
    angle, pressure_angle : rad
    rpm : 1/min
    lift, gap : m; a gap of 0 is contact
    force : N
    max_lift : of the picture, m; a follower above it is drawn there

    Examples
    --------
    >>> one = np.ones(1)
    >>> print(readings(one, 400.0, 5e-3 * one, 117.0 * one, 0.0 * one, 0.2 * one)[0])
    ```
    θ       57.3°       400 rpm
    lift    5.000 mm    in contact
    force   117.0 N     pressure angle 11.5°
    ```
    """
    columns = (
        np.degrees(np.mod(angle, TURN)),
        lift * 1e3,
        force,
        gap * 1e6,
        np.degrees(pressure_angle),
    )
    return [_words(rpm, 1e3 * max_lift, *row) for row in np.stack(columns, axis=1).tolist()]


def no_readings(rpm: float) -> str:
    """Markdown of a cam that begins to turn (1/min), before its first frame."""
    return _lines(("", "", ""), (f"{rpm:.4g} rpm", "", ""))


def _words(
    rpm: float, edge: float, theta: float, lift: float, force: float, gap: float, lean: float
) -> str:
    off = gap != 0.0
    left = f"{theta:.1f}°", f"{lift:.3f} mm", f"{force:.1f} N"
    state = f"gap {four_digits(gap)} µm" if off else "in contact"
    angle = "not touched" if off else f"pressure angle {lean:.1f}°"
    if lift > edge:
        angle = f"drawn at {edge:.0f} mm"
    return _lines(left, (f"{rpm:.4g} rpm", state, angle))


def _lines(left: tuple[str, str, str], right: tuple[str, str, str]) -> str:
    names = "θ", "lift", "force"
    lines = [f"{a:<8}{b:<12}{c}".rstrip() for a, b, c in zip(names, left, right, strict=True)]
    return "\n".join(["```", *lines, "```"])


def send_readings(
    stream: rr.RecordingStream, entity: str, at: list[rr.TimeColumn], words: list[str]
) -> None:
    """Show them, each at its time."""
    columns = rr.TextDocument.columns(text=words, media_type=["text/markdown"] * len(words))
    stream.send_columns(entity, at, columns)
