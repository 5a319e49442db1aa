"""What the board writes: the cam's file, the contour as DXF, and the command that designs on."""

from __future__ import annotations

import io
import shlex
from pathlib import Path
from typing import Any

from cam_rig.errors import CamRigError, ConfigError, OutputError, ProfileError
from cam_rig.extras import require
from cam_rig.law_design.cam_file import without_empty
from cam_rig.laws import Law
from cam_rig.panel.board.drawable import DRAWN
from cam_rig.profile.check_table import check_cam
from cam_rig.schema import CamConfig
from cam_rig.schema.load import NAME, quantity, to_yaml, valid_cam
from cam_rig.units import FloatArray

#: Largest distance (m) of the DXF's chords from the contour.
CHORD_ERROR = 1e-6
#: What a design from the board is to reach, and to keep.
GOAL, LIMIT = "jump_speed", "peak_acceleration<=start"


def require_name(name: Any) -> str:
    """What a cam may be called."""
    if not (isinstance(name, str) and NAME.fullmatch(name)):
        raise ConfigError("name: allowed: up to 100 small letters, digits and _, a letter first")
    return name


def why_not_made(cam: CamConfig, law: Law) -> str | None:
    """What of a law on its cam cannot exist, in words; None where it can be made."""
    try:
        failed = [str(check) for check in check_cam(cam, law) if check.vital and not check.passed]
    except CamRigError as error:
        failed = [str(error)]
    return "; ".join(failed) or None


def cam_text(
    name: str, cam: CamConfig, file: CamConfig, ordinates: FloatArray, why_not: str | None
) -> str:
    """The file of a drawn cam with other ordinates ``(m,)``, begun from a file.

    It says ``why_not``, where the cam cannot be made.
    """
    data = cam.model_dump(exclude_none=True)
    data |= {"name": name, "title": f"{file.title}, drawn"}
    data.pop("cannot_be_made", None)
    data.pop("identified_from", None)
    source, at = f"drawn on the panel, from {file.name}", 0
    for part, segment in zip(data["segments"], cam.segments, strict=True):
        if isinstance(segment, DRAWN):
            count = len(segment.ordinates.numbers)
            own = ordinates[at : at + count].tolist()
            part["ordinates"] = quantity("assumed", own, "1", source)
            at += count
    if why_not is not None:
        data["cannot_be_made"] = why_not
    data["segments"] = [without_empty(part) for part in data.pop("segments")]
    plain = {key: without_empty(x) if isinstance(x, dict) else x for key, x in data.items()}
    valid_cam(plain)
    return f"# Drawn with cam-rig panel; dwells and spans are those of {file.name}.\n" + (
        to_yaml(plain)
    )


def write_new(path: Path, text: str) -> None:
    """Write a file that is not there yet."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise OutputError(
            f"{path}: exists already, not overwriting; name another or move it"
        ) from None
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from None


def contour_dxf(cam: CamConfig, law: Law) -> str:
    """The contour in mm, as `cam-rig profile --out` writes it."""
    for library in ("ezdxf", "shapely"):
        require(library)
    if why := why_not_made(cam, law):
        raise ProfileError(f"cannot be made: {why}")
    from cam_rig.profile.drawing_files import to_document
    from cam_rig.profile.polyline import contour_paths, polyline

    curves = contour_paths(cam.follower, law)
    text = io.StringIO()
    to_document({curve.name: polyline(curve, CHORD_ERROR) for curve in curves}).write(text)
    return text.getvalue()


def designed_path(start: Path) -> Path:
    """Where a design from a saved cam is written."""
    return start.with_name(f"{start.stem}_designed.yaml")


def design_command(path: Path, rig: str) -> str:
    """What designs the fastest law from a saved cam, as it is typed."""
    words = ("cam-rig", "design", str(path), "--maximise", GOAL, "--limit", LIMIT)
    return shlex.join([*words, "--rig", rig, "--out", str(designed_path(path))])
