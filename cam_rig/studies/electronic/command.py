"""Command ``cam-rig electronic``: cams for motion controllers, and back."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from cam_rig.errors import ConfigError
from cam_rig.files import atomic_write, check_writable, new_yaml
from cam_rig.schema.quantity import NUMBER_WITH_UNIT, UNIT_SPELLINGS, UNITS
from cam_rig.show.command import RigOfCam, command
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import say
from cam_rig.studies.electronic.names import InterpolationName, RoundingName, TargetName

Acceleration = Annotated[str, typer.Option(help="Largest error of s″, of its peak.")]
Points = Annotated[str | None, typer.Option(help="Numbers of points of tables to compare: 64,256.")]
Interpolations = Annotated[
    str, typer.Option(help="Interpolations of tables: linear,cubic,spline,sliding.")
]
Numbers = Annotated[RoundingName, typer.Option(help="Numbers of tables.")]
Read = Annotated[Path | None, typer.Option(metavar="FILE", help="Read a controller's text.")]
Form = Annotated[TargetName, typer.Option("--as", help="Form of the text to read.")]
Out = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Write the text, or with --read the cam file."),
]


@command("json", "csv", "plot")
def electronic(
    cam: Annotated[str | None, typer.Argument(help="Cam file, or a name in config/cams.")] = None,
    target: Annotated[TargetName, typer.Option(help="Form of the text.")] = "codesys",
    lift_error: Annotated[str, typer.Option(help="Largest error of the lift.")] = "0.002um",
    acceleration_error: Acceleration = "0.1%",
    points: Points = None,
    interpolation: Interpolations = "spline",
    rounding: Numbers = "lreal",
    increments: Annotated[float, typer.Option(help="Increments per mm of dint.")] = 1000.0,
    rig: RigOfCam = None,
    rpm: Annotated[float, typer.Option(help="Cam speed of the vibration.")] = 300.0,
    read: Read = None,
    as_: Form = "codesys",
    out: Out = None,
    *,
    progress: Progress,
) -> Result:
    """Write a cam for a motion controller, with proven errors, or read one back.

    The law becomes the fewest segments with the requested errors, or a table of points. Named laws
    that the controller has pass exactly. With --points, the table has the residual vibration and
    the jump speed of each form on the rig. With --read, a controller's text becomes a cam file of
    what the controller does.

    In Python: cam_rig.electronic(cam, target, lift_error, acceleration_error, points, …)

    Examples
    --------
    cam-rig electronic bezier15 --lift-error 1um --acceleration-error 0.5% --out cam.st

    cam-rig electronic poly4567 --points 64,256 --interpolation cubic,spline --plot out/table.png

    cam-rig electronic --read cam.st --as codesys --out back.yaml
    """
    from cam_rig.studies.electronic import study

    if (cam is None) == (read is None):
        raise ConfigError("a cam or --read FILE is required, and they cannot be combined")
    if read is not None and (points is not None or rig is not None):
        raise ConfigError("--read cannot be combined with --points or --rig; use its cam file")
    if read is not None:
        target_file = new_yaml(out)
        kinds = _interpolations(interpolation)
        if len(kinds) > 1:
            raise ConfigError(f"--read requires one --interpolation, got {interpolation!r}")
        reading = study.read_electronic(read, as_, kinds[0], out.stem if out else None)
        _write(target_file, reading.text)
        return reading
    if out is not None:
        check_writable(out)
    assert cam is not None
    result = study.electronic(
        cam,
        target,
        _number("--lift-error", lift_error, UNITS["length"], "1um"),
        _number("--acceleration-error", acceleration_error, {"%": 0.01, "": 1.0}, "0.5%"),
        _counts(points),
        _interpolations(interpolation),
        rounding,
        increments,
        rig,
        rpm,
        progress=progress,
    )
    _write(out, result.text)
    return result


def _write(out: Path | None, text: str) -> None:
    """Write a text to a file, if it is requested, and print its path."""
    if out is not None:
        with atomic_write(out) as part:
            part.write_text(text, encoding="utf-8")
        say(f"written: {out}")


def _interpolations(text: str) -> list[InterpolationName]:
    """Return the interpolations in a text such as linear,cubic."""
    names = get_args(InterpolationName)
    words: list[Any] = text.split(",")
    if not set(words) <= set(names):
        raise ConfigError(f"--interpolation must be {' or '.join(names)}, got {text!r}")
    return words


def _number(option: str, text: str, units: dict[str, float], example: str) -> float:
    """Return the number of a text with a unit, in SI."""
    match = NUMBER_WITH_UNIT.fullmatch(text.translate(UNIT_SPELLINGS))
    if match is None or match[2] not in units:
        raise ConfigError(f"{option} must be a number with a unit such as {example}, got {text!r}")
    return float(match[1]) * units[match[2]]


def _counts(text: str | None) -> list[int] | None:
    """Return the numbers of points in a text such as 64,256."""
    if text is None:
        return None
    words = text.split(",")
    if not all(word.strip().isdigit() for word in words):
        raise ConfigError(f"--points must be whole numbers such as 64,256, got {text!r}")
    return [int(word) for word in words]
