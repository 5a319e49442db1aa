"""Texts for motion controllers with proven errors, and their effect on the follower.

A cam is written as segments of a controller or as a table of points. The law that the controller
executes is made from the written digits alone. Its difference from the exact law is bounded, and
both drive the follower of a rig.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from cam_rig.arguments import check_arguments
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.any_follower import find_contact_loss_speed
from cam_rig.dynamics.vibration import LowDwell, low_dwell, require_speeds, steady_turn
from cam_rig.errors import CamRigError, ConfigError, LawError
from cam_rig.files import MIB, read_bytes
from cam_rig.laws.cam import require_sprung
from cam_rig.laws.law import JUMP_RTOL, Law, format_continuity, peak
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import cam_path
from cam_rig.show.result import NULL_PROGRESS, Column, Footnote, Progress, Records, Result
from cam_rig.simulation.inputs import (
    DEFAULT_RIG,
    Cam,
    Rig,
    build_law,
    default_rig,
    resolve_cam,
    resolve_rig,
)
from cam_rig.studies.electronic.building import BRIDGE_DEG, Target, controller_cam
from cam_rig.studies.electronic.cam_file import controller_cam_file
from cam_rig.studies.electronic.controller import ControllerCam
from cam_rig.studies.electronic.csv_text import (
    read_segments,
    read_table,
    write_segments,
    write_table,
)
from cam_rig.studies.electronic.difference import ErrorBounds, difference_bounds
from cam_rig.studies.electronic.names import InterpolationName, RoundingName, TargetName
from cam_rig.studies.electronic.segmentation import Tolerances
from cam_rig.studies.electronic.structured_text import identifier, read_text, write_text
from cam_rig.studies.electronic.tables import (
    MAX_INTERVALS,
    Interpolation,
    PointTable,
    Rounding,
    sample_table,
    table_law,
)
from cam_rig.units import RPM

#: Name of the form of a table of points among the targets.
TABLE = "table"
#: Default cam speed, rpm. It is below the jump speeds of the paper's laws.
CONTROLLER_RPM = 300.0
#: Largest relative excess of the vibration over that of the law that is not reported.
MAX_EXCESS = 0.05
#: Largest relative loss of jump speed that is not reported.
MAX_JUMP_LOSS = 0.01
#: Largest size of a text in bytes.
MAX_BYTES = 4 * MIB
#: Name of this study in the error message for a rig without a stem.
BY = "the vibration of a mass on its stem"


@dataclass(frozen=True)
class ControllerRow:
    """Form of a cam in a controller, its errors, and the motion of the follower.

    Parameters
    ----------
    form : str
        "law" for the exact law, else target or interpolation.
    count : int or None
        Number of segments, or of points without the closing point. None for the exact law.
    bounds : ErrorBounds
        Proven bounds of the error.
    law : Law
        Law that the controller executes.
    vibration : float or None
        Peak-to-peak vibration in the low dwell of the exact law, m. None without a rig.
    jump_rpm : float or None
        Jump speed in rpm, 0 if the velocity jumps. None without a rig.
    """

    form: str
    count: int | None
    bounds: ErrorBounds
    law: Law
    vibration: float | None = None
    jump_rpm: float | None = None


@dataclass(frozen=True, repr=False)
class ElectronicResult(Result):
    """Forms of a cam in a controller, the exact law first, and the text of the requested form.

    ``rpm`` is the cam speed of the vibration. ``rig`` is None if no motion was computed.
    ``warnings`` are sentences on the forms.
    """

    schema = "cam_rig.electronic.1"
    plot_function = "cam_rig.studies.electronic.figures:figure"
    columns: ClassVar = {
        "forms": (
            Column("form"),
            Column("count", "", "d", "segments or points"),
            Column("lift_error", "µm", ".3g", "error of s", "bounds.lift"),
            Column("velocity_error", "mm/rad", ".3g", "of s′", "bounds.velocity"),
            Column("acceleration_error", "mm/rad²", ".3g", "of s″", "bounds.acceleration"),
            Column("jerk_jump_error", "mm/rad³", ".3g", "of jumps of s‴", "bounds.jerk_jump"),
            Column("vibration", "µm", ".3g", "residual vibration", doc="peak to peak"),
            Column("jump_rpm", "rpm", ".2f", "jump speed"),
        )
    }

    cam: CamConfig
    rows: tuple[ControllerRow, ...]
    text: str
    rig: RigConfig | None
    rpm: float
    warnings: tuple[str, ...]

    def tables(self) -> list[Records]:
        """Return the table ``forms``, with one row per form."""
        on_rig = "" if self.rig is None else f", on rig {self.rig.name} at {self.rpm:g} rpm"
        notes = [
            Footnote("Errors: proven upper bounds, with the rounding of the written digits."),
            Footnote("An infinite error of s″: the velocity jumps.", _has_corner),
        ]
        if self.rig is not None:
            notes.append(Footnote("Residual vibration: peak to peak in the law's low dwell."))
        return [self.table("forms", f"{self.cam.name} in a controller{on_rig}", self.rows, *notes)]

    def summary(self) -> list[str]:
        """Return the warnings."""
        return list(self.warnings)


def _has_corner(row: ControllerRow) -> bool:
    return math.isinf(row.bounds.acceleration)


@check_arguments
def electronic(
    cam: Cam,
    target: TargetName = "codesys",
    lift_error: float = Tolerances().lift,
    acceleration_error: float = Tolerances().acceleration,
    points: int | Sequence[int] | None = None,
    interpolation: InterpolationName | Sequence[InterpolationName] = "spline",
    rounding: RoundingName = "lreal",
    increments: float = 1000.0,
    rig: Rig = None,
    rpm: float = CONTROLLER_RPM,
    *,
    progress: Progress = NULL_PROGRESS,
) -> ElectronicResult:
    """Write a cam for a motion controller, with proven errors.

    The vibration and the jump speed of each form are computed if ``points`` or ``rig`` is given.
    The command is ``cam-rig electronic``.

    Parameters
    ----------
    cam : str, Path or Cam
        Cam by its name in ``config/cams``, its path, or as the object.
    target : str
        Form of the text: ``codesys``, ``codesys_builder``, ``twincat``, ``twincat_mc3``,
        ``vdi2143`` or ``table`` (default: codesys).
    lift_error : float
        Largest error of s in m (default: 2e-9, 0.002 µm).
    acceleration_error : float
        Largest error of s'' as a fraction of its peak (default: 0.001).
    points : int or sequence of int, optional
        Numbers of points of the tables to compare (default: no table).
    interpolation : str or sequence of str
        Interpolations of the tables: ``linear``, ``cubic``, ``spline``, ``sliding``.
    rounding : str
        Numbers of the tables: ``lreal``, ``real`` or ``dint``.
    increments : float
        Increments per mm of ``dint`` (default: 1000).
    rig : str, Path or Rig, optional
        Rig with a stem (default with points: the only rig next to the cam, else
        ``paper_table2``).
    rpm : float
        Cam speed of the vibration, rpm (default: 300).
    progress : Progress
        Receiver of the progress.

    Returns
    -------
    ElectronicResult
        Errors and motion of each form. Its ``text`` is that of the target.

    Raises
    ------
    ConfigError
        A value is out of range, the target cannot pass the law, or the rig has a rigid stem.

    Examples
    --------
    >>> import cam_rig
    >>> result = cam_rig.electronic("bezier15", lift_error=1e-6, acceleration_error=0.005)
    >>> result.rows[1].count, result.text.split()[0]
    (12, '(*')
    """
    config, law = resolve_cam(cam), build_law(cam)
    tolerances = _tolerances(lift_error, acceleration_error)
    counts = [points] if isinstance(points, int) else list(points or ())
    names = [interpolation] if isinstance(interpolation, str) else list(interpolation)
    tables = [
        (Interpolation(name), sample_table(law, count, Rounding(rounding), increments))
        for name in names
        for count in counts
    ]
    if target == TABLE and len(tables) != 1:
        raise ConfigError("--target table requires one number of --points and one interpolation")
    rows = [ControllerRow("law", None, ErrorBounds(0.0, 0.0, 0.0, 0.0), law)]
    rows += [_table_row(law, table, kind) for kind, table in tables]
    if target == TABLE:
        text, warnings = _table_text(config, *tables[0], rows[-1].bounds), []
    else:
        form = Target(target)
        segments = controller_cam(config, law, form, tolerances)
        bounds = difference_bounds(law, segments.law)
        rows.append(ControllerRow(target, len(segments.segments), bounds, segments.law))
        text, warnings = _segment_text(config, segments, form, bounds), list(_notes(law, form))
    used = None
    if rig is not None or (counts and config.follower.sprung):
        require_sprung(config.name, config)
        on_rig = used = _rig_of(cam, rig)

        def tabulate(kind: Interpolation, count: int) -> ControllerRow:
            table = sample_table(law, count, Rounding(rounding), increments)
            return _with_motion(_table_row(law, table, kind), law, on_rig, rpm)

        rows = [_with_motion(row, law, used, rpm) for row in progress.track(rows)]
        warnings += _vibration_warnings(rows, tabulate)
    return ElectronicResult(config, tuple(rows), text, used, rpm, tuple(warnings))


def _table_row(law: Law, table: PointTable, kind: Interpolation) -> ControllerRow:
    """Return the row of a table of points of a law, without the motion of the follower."""
    made = table_law(table, kind)
    return ControllerRow(kind.value, table.x.size - 1, difference_bounds(law, made), made)


def _tolerances(lift_error: float, acceleration_error: float) -> Tolerances:
    """Return the largest errors after a check of their range."""
    if not 1e-10 <= lift_error <= 1e-3:
        raise ConfigError(f"--lift-error must be 0.1 nm to 1 mm, got {lift_error * 1e6:g} µm")
    if not 1e-6 <= acceleration_error <= 1.0:
        raise ConfigError(
            f"--acceleration-error must be between 1e-6 and 1, got {acceleration_error:g}"
        )
    return Tolerances(lift_error, acceleration_error)


def _rig_of(cam: Cam, rig: Rig) -> RigConfig:
    """Return the rig of the follower."""
    if rig is not None:
        return resolve_rig(rig, cam)
    return resolve_rig(
        DEFAULT_RIG if isinstance(cam, CamConfig) else default_rig([cam_path(cam)]), cam
    )


def _upper(value: float) -> str:
    """Return a bound with three significant digits, rounded up."""
    if value == 0.0:
        return "0"
    step = 10.0 ** (math.floor(math.log10(value)) - 2)
    text = f"{value:.3g}"
    return text if float(text) >= value else f"{value + step:.3g}"


def _header(cam: CamConfig, form: str, bounds: ErrorBounds) -> tuple[str, ...]:
    """Return the comment lines of a text: source, units and bounds."""
    return (
        f"{cam.title or cam.name}: {form}, made by cam-rig electronic.",
        "Master in degrees, slave in mm, derivatives by the master position.",
        f"Proven errors: lift {_upper(bounds.lift * 1e6)} um, velocity "
        f"{_upper(bounds.velocity * 1e3)} mm/rad, acceleration "
        f"{_upper(bounds.acceleration * 1e3)} mm/rad^2, jumps of the jerk "
        f"{_upper(bounds.jerk_jump * 1e3)} mm/rad^3.",
    )


def _segment_text(
    cam: CamConfig, segments: ControllerCam, target: Target, bounds: ErrorBounds
) -> str:
    """Return the text of segments with its comment lines."""
    kind = f"{len(segments.segments)} segments for {target.value}"
    return write_controller(replace(segments, notes=_header(cam, kind, bounds)), target)


def _table_text(cam: CamConfig, kind: Interpolation, table: PointTable, bounds: ErrorBounds) -> str:
    """Return the text of a table of points with its comment lines."""
    form = f"{table.x.size - 1} points for interpolation {kind.value}"
    return write_table(replace(table, notes=_header(cam, form, bounds)))


def write_controller(cam: ControllerCam, target: Target) -> str:
    """Return the text of a controller's cam."""
    return write_segments(cam) if target is Target.VDI2143 else write_text(cam, target)


def _notes(law: Law, target: Target) -> Iterator[str]:
    """Yield sentences on the joints of a law at which the controller moves otherwise."""
    corners = ", ".join(f"{math.degrees(law.joints[piece]):.4g}°" for piece in law.velocity_jumps)
    if corners:
        yield f"warning: the velocity jumps at {corners}; the lines there are as the law is"
    jumps = np.abs(law.jumps(2)) > JUMP_RTOL * abs(peak(law, 2).value)
    jumps[list(law.velocity_jumps)] = False
    if target.shares_boundaries and jumps.any():
        at = ", ".join(f"{math.degrees(angle):.4g}°" for angle in law.breaks[:-1][jumps])
        yield (
            f"s″ jumps at {at}; it moves linearly over {BRIDGE_DEG:g}° there, which the error of "
            "s″ includes"
        )


# Motion of the follower under each form.


def dwell_vibration(law: Law, follower: FollowerParameters, rpm: float, window: LowDwell) -> float:
    """Return the peak-to-peak vibration (m) of the follower in the low dwell of the exact law."""
    turn = steady_turn(law, follower, rpm * RPM)
    return float(np.ptp(turn.vibration[window.contains(turn.angle)]))


def _with_motion(row: ControllerRow, exact: Law, rig: RigConfig, rpm: float) -> ControllerRow:
    """Return a row with the vibration and the jump speed on a rig."""
    follower = FollowerParameters.on_stem(rig, BY)
    require_speeds(follower, [rpm])
    vibration = dwell_vibration(row.law, follower, rpm, low_dwell(exact))
    return replace(row, vibration=vibration, jump_rpm=find_contact_loss_speed(row.law, rig) / RPM)


def _is_restored(row: ControllerRow, exact: ControllerRow) -> bool:
    """Return True if the follower vibrates and jumps as under the exact law."""
    vibration = (row.vibration or 0.0) <= (1.0 + MAX_EXCESS) * (exact.vibration or 0.0)
    return vibration and (row.jump_rpm or 0.0) >= (1.0 - MAX_JUMP_LOSS) * (exact.jump_rpm or 0.0)


def _vibration_warnings(
    rows: list[ControllerRow], tabulate: Callable[[Interpolation, int], ControllerRow]
) -> Iterator[str]:
    """Yield a sentence for each interpolation that causes vibration, with a remedy.

    The remedy is the smallest number of points that restores the motion of the law, doubled from
    the largest of the table. ``tabulate`` returns the row of an interpolation and a number.
    """
    exact = rows[0]
    for kind in Interpolation:
        tables = [row for row in rows if row.form == kind.value]
        bad = [row for row in tables if not _is_restored(row, exact)]
        if not bad:
            continue
        worst = max(bad, key=lambda row: row.vibration or 0.0)
        sufficient = [row.count or 0 for row in tables if row not in bad]
        count = min(sufficient, default=0)
        tried = 2 * max(row.count or 0 for row in tables)
        while not count and tried <= MAX_INTERVALS // 2:
            count = tried if _is_restored(tabulate(kind, tried), exact) else 0
            tried *= 2
        points = f"at least {count} points" if count else "no table of this kind"
        yield (
            f"the controller, not the law, causes {1e6 * (worst.vibration or 0.0):.3g} µm of "
            f"vibration and a jump speed of {worst.jump_rpm:.1f} rpm with {worst.count} points, "
            f"{kind.value} (law: {1e6 * (exact.vibration or 0.0):.3g} µm, {exact.jump_rpm:.1f} "
            f"rpm); use {points}, or polynomial segments"
        )


# Cam of a text of a controller.


@dataclass(frozen=True, repr=False)
class ControllerReading(Result):
    """Cam of a controller's text: its cam, its law and the text of its file."""

    schema = "cam_rig.controller_reading.1"
    columns: ClassVar = {
        "reading": (
            Column("cam", of="law.name"),
            Column("segments", "", "d"),
            Column("lift", "mm", ".6g", of="law.lift"),
            Column("continuity", doc="class of the roughest joint"),
        )
    }

    cam: CamConfig
    law: Law
    text: str
    segments: int
    notes: tuple[str, ...]

    @property
    def continuity(self) -> str:
        """Class of the roughest joint, such as "C2"."""
        return format_continuity(self.law)

    def tables(self) -> list[Records]:
        """Return the table ``reading`` with one row."""
        return [self.table("reading", "Cam of the controller", [self], single=True)]

    def summary(self) -> list[str]:
        """Return the comment lines of the text."""
        return list(self.notes)


@check_arguments
def read_electronic(
    file: str | Path,
    target: TargetName,
    interpolation: InterpolationName = "spline",
    name: str | None = None,
) -> ControllerReading:
    """Read the cam of a controller's text, with its roundings and its interpolation.

    The command is ``cam-rig electronic --read FILE --as TARGET``.

    Parameters
    ----------
    file : str or Path
        Text of a controller.
    target : str
        Form of the text, as in `electronic`.
    interpolation : str
        Interpolation of a table of points (default: spline).
    name : str, optional
        Name of the cam (default: that in the text).

    Returns
    -------
    ControllerReading
        Cam, law, and the text of the cam file.

    Raises
    ------
    ConfigError
        The file cannot be read, is a text of another controller, or a line is wrong.

    Examples
    --------
    >>> import cam_rig
    >>> from pathlib import Path
    >>> Path("out").mkdir(exist_ok=True)
    >>> _ = Path("out/cam.st").write_text(cam_rig.electronic("poly345", "twincat").text)
    >>> cam_rig.read_electronic("out/cam.st", "twincat").law.degree
    5
    """
    path = Path(file)
    try:
        content = read_bytes(path, MAX_BYTES).decode("utf-8-sig")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise ConfigError(f"{path}: line {line}: not UTF-8; save the text as UTF-8") from None
    except CamRigError as error:
        raise ConfigError(f"{path}: {error}") from None
    try:
        if target == TABLE:
            table = read_table(path.name, content)
            law, notes = table_law(table, Interpolation(interpolation)), table.notes
            count = table.x.size - 1
        else:
            form = Target(target)
            if form is Target.VDI2143:
                cam = read_segments(path.name, content)
            else:
                cam = read_text(path.name, content, form)
            law, notes, count = cam.law, cam.notes, len(cam.segments)
    except LawError as error:
        lines = content.count("\n")
        raise ConfigError(f"{path.name}: line {lines}: {error}") from None
    label = identifier(name or law.name).lower()
    config, text = controller_cam_file(law, label, path.name)
    return ControllerReading(config, replace(law, name=label), text, count, notes)
