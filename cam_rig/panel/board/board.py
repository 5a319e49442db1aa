"""State of the drawing board: cam, rig, ordinates, speed and data of its page.

The ordinates are the control values of the Bézier or B-spline segments of the law, as fractions of
the lift. A person moves them on the curve.
"""

from __future__ import annotations

import io
import shlex
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.any_follower import TWO_MASSES, describe_follower, follower_of
from cam_rig.dynamics.jump.two_masses import REST_DURATION_S
from cam_rig.errors import ConfigError, ProfileError, RefusedError
from cam_rig.extras import require
from cam_rig.files import write_new
from cam_rig.laws import Law, build_law
from cam_rig.panel import is_number
from cam_rig.panel.bench.drawing import cam_picture
from cam_rig.panel.board import drawn_law
from cam_rig.panel.board.drawable import DRAWABLE_SEGMENTS, evaluate_fast, failed_checks
from cam_rig.panel.board.drawn_law import DrawnLaw, in_base64
from cam_rig.schema import CamConfig, RigConfig, load
from cam_rig.schema.explain import explain
from cam_rig.schema.load import config_root, load_cam
from cam_rig.schema.segments import BSpline
from cam_rig.schema.yaml_text import parse_yaml
from cam_rig.simulation.scene import is_calibrated
from cam_rig.units import FloatArray

#: Lowest accepted cam speed, rpm.
MIN_RPM = 1.0
#: Highest accepted cam speed, rpm.
MAX_RPM = 1e5
#: Cam speed at which the board starts, rpm.
START_RPM = 300.0
#: Largest absolute value of an ordinate of a law, as a multiple of the lift. It is the limit of cam
#: files.
MAX_ORDINATE = 100.0


class Board:
    """Drawing board of a cam on a rig, whose law has movable ordinates.

    The ordinates are the control values of the segments. `rig_name` is the rig's name in commands.
    Files are written to `out`.
    """

    def __init__(
        self, cam: CamConfig, rig: RigConfig, out: Path, rig_name: str | None = None
    ) -> None:
        self.rig, self.out = rig, out
        self.rig_name = rig.name if rig_name is None else rig_name
        self.rpm, self.version = START_RPM, 0
        self._draw(cam, DrawnLaw.of(cam))

    def _draw(self, cam: CamConfig, drawn: DrawnLaw) -> None:
        self.file, self.drawn, self.ordinates = cam, drawn, drawn.ordinates
        self._free = np.array([handle.index for handle in drawn.handles], dtype=np.intp)

    def open(self, text: Any) -> None:
        """Replace the cam of the board by that of a cam file's text.

        Raises RefusedError or ConfigError if the text is not a cam file, and leaves the board
        unchanged.
        """
        if not isinstance(text, str):
            raise RefusedError("text: missing; allowed: the text of a cam file")
        try:
            cam = CamConfig.model_validate(parse_yaml(text))
        except ValidationError as error:
            raise ConfigError(f"not a cam file: {explain(error, CamConfig)}") from None
        self._draw(cam, DrawnLaw.of(cam))
        self.version += 1

    @property
    def cam(self) -> CamConfig:
        """Cam whose ordinates are changed on the board.

        Its follower, spans and dwells are fixed.
        """
        return self.drawn.start.cam

    def law(self, ordinates: FloatArray | None = None) -> Law:
        """Return the law with the given ordinates ``(m,)`` (default: those of the board)."""
        return self.drawn.law(self.ordinates if ordinates is None else ordinates, self.cam.name)

    def update(self, ordinates: Any, rpm: Any) -> None:
        """Apply ordinates and speed (rpm) from a page to the board.

        The fixed ordinates at the ends of segments do not change. Raises RefusedError for invalid
        values.
        """
        valid = self._validate(ordinates)
        if not (is_number(rpm) and MIN_RPM <= rpm <= MAX_RPM):
            raise RefusedError(f"rpm: is {rpm!r:.40}; allowed: {MIN_RPM:g} to {MAX_RPM:g}")
        self.ordinates, self.rpm = valid, float(rpm)
        self.version += 1

    def _validate(self, values: Any) -> FloatArray:
        count = self.ordinates.size
        if not (isinstance(values, list) and len(values) == count and all(map(is_number, values))):
            raise RefusedError(f"ordinates: allowed: a list of {count} numbers")
        ordinates = self.drawn.ordinates.copy()
        ordinates[self._free] = np.array(values, dtype=np.float64)[self._free]
        if not np.abs(ordinates).max() <= MAX_ORDINATE:
            raise RefusedError(f"ordinates: allowed: -{MAX_ORDINATE:g} to {MAX_ORDINATE:g} lifts")
        return ordinates

    def evaluate_fast(self) -> dict[str, Any]:
        """Return those results for the board's law that are computed in milliseconds.

        They are the contours, their faults and the jump speed, see `drawable.evaluate_fast`, and
        the version of the board.
        """
        return {"version": self.version} | evaluate_fast(self.cam, self.law(), self.rig)

    def page_data(self) -> dict[str, Any]:
        """Return the data of the board that a page needs once.

        They contain names, numbers of the rig, the movable ordinates, and the linear map from the
        ordinates to the motion.
        """
        start, table, cam = self.drawn.start, self.drawn.table, self.cam
        follower = FollowerParameters.from_rig(self.rig)
        calibrated = is_calibrated(self.rig, "one_mass")
        splines = None
        if not start.has_file_ordinates:
            degree = max(s.degree for s in cam.segments if isinstance(s, BSpline))
            splines = {"degree": degree, "exact": start.exact, "distance_m": start.distance}
        return {
            "cam": {
                "name": self.file.name,
                "title": self.file.title,
                "lift_m": cam.lift.si,
                "sprung": cam.follower.sprung,
            },
            "b_splines": splines,
            "start_can_be_made": not evaluate_fast(cam, start.law, self.rig)["faults"],
            "picture": cam_picture(cam, start.law),
            "rig": {
                "name": self.rig.name,
                "mass": follower.mass,
                "damping": follower.damping,
                "spring_stiffness": follower.spring_stiffness,
                "preload": follower.preload,
                "two_masses": describe_follower(follower_of(self.rig)) == TWO_MASSES,
                "from_rest_s": REST_DURATION_S,
                # empty if the level of one mass is only relative
                "calibrated_on": self.rig.calibrated_on if calibrated else "",
            },
            "rpm": self.rpm,
            "rpm_range": [MIN_RPM, MAX_RPM],
            "ordinates": self.ordinates.tolist(),
            "start": self.drawn.ordinates.tolist(),
            "handles": [asdict(handle) for handle in self.drawn.handles],
            "cams": shipped_titles(),
            "points": drawn_law.MOTION_POINTS,
            "orders": drawn_law.ORDERS,
            "first": in_base64(table.first),
            "table": in_base64(table.table),
            "constant": in_base64(table.constant),
        }

    def shipped_law(self, name: str) -> dict[str, Any]:
        """Return the law of a shipped cam for comparison.

        The motion is ``(4, n)`` in m/rad^order, as base64.
        """
        law = build_law(load_cam(load.Library((config_root(),)).path("cams", name)))
        return {"name": name, "motion": drawn_law.motion_in_base64(law)}

    def save(self, name: Any, ordinates: Any) -> Path:
        """Write a cam file with the given ordinates, and return its path.

        If a cam with this law cannot be made, the file contains the reason.
        """
        path = self.out / f"{require_name(name)}.yaml"
        write_new(self.out, {path.name: self._file_text(path.stem, ordinates)})
        return path

    def cam_of(self, name: str, ordinates: Any) -> CamConfig:
        """Return the cam with a name and the given ordinates, without writing a file."""
        return CamConfig.model_validate(parse_yaml(self._file_text(name, ordinates)))

    def _file_text(self, name: str, ordinates: Any) -> str:
        valid = self._validate(ordinates)
        reason = "; ".join(failed_checks(self.cam, self.law(valid))[0]) or None
        return cam_text(name, self.cam, self.file, valid, reason)

    def save_for_page(self, name: Any, ordinates: Any) -> dict[str, Any]:
        """Write a cam file with the given ordinates, and return data on the file.

        The data are the path, the command that optimises the cam (cam-rig design), and the reason
        if the cam cannot be made.
        """
        path = self.save(name, ordinates)
        arguments = ["cam-rig", "design", str(path), "--maximise", GOAL, "--limit", LIMIT]
        arguments += ["--rig", self.rig_name, "--out", str(designed_path(path))]
        return {
            "path": str(path),
            "command": shlex.join(arguments),
            "cannot_be_made": load_cam(path).cannot_be_made,
        }

    def dxf(self, ordinates: Any) -> str:
        """Return the contour of the cam with the given ordinates as text of a DXF file.

        Lengths are in mm. `cam-rig profile --out` writes the same file. Raises ProfileError if the
        cam cannot be made.
        """
        cam, law = self.cam, self.law(self._validate(ordinates))
        for library in ("ezdxf", "shapely"):
            require(library)
        if reasons := failed_checks(cam, law)[0]:
            raise ProfileError(f"cannot be made: {'; '.join(reasons)}")
        from cam_rig.profile.drawing_files import to_document
        from cam_rig.profile.polyline import contour_paths, polyline

        curves, text = contour_paths(cam.follower, law), io.StringIO()
        to_document({curve.name: polyline(curve, CHORD_ERROR) for curve in curves}).write(text)
        return text.getvalue()


# Output of the board: cam file, contour as DXF, and command of a design from the drawn cam.

#: Largest distance of the DXF's chords from the contour, m.
CHORD_ERROR = 1e-6
#: Quantity that is maximised when a drawn cam is optimised with `cam-rig design`.
GOAL = "jump_speed"
#: Limit of that optimisation: the peak acceleration must not exceed that of the drawn cam.
LIMIT = "peak_acceleration<=start"


@cache
def shipped_titles() -> dict[str, str]:
    """Return the titles of the shipped cams by their names, in the order of the titles."""
    cams = map(load_cam, sorted((config_root() / "cams").glob("*.yaml")))
    return dict(sorted(((cam.name, cam.title) for cam in cams), key=lambda item: item[1].lower()))


def require_name(name: Any) -> str:
    """Return a cam's name, or raise ConfigError if it is not valid."""
    if not (isinstance(name, str) and load.NAME.fullmatch(name)):
        raise ConfigError("name: allowed: a letter, then up to 99 small letters, digits and _")
    return name


def cam_text(
    name: str, cam: CamConfig, file: CamConfig, ordinates: FloatArray, reason: str | None
) -> str:
    """Return the text of a cam file with the ordinates ``(m,)`` that were drawn.

    `cam` has the drawn segments, and `file` is the cam from which the drawing started. `reason` is
    the reason why the cam cannot be made, None if it can be made.
    """
    data = load.file_data(cam) | {"name": name, "title": f"{file.title}, drawn"}
    data.pop("cannot_be_made", None)
    data.pop("identified_from", None)
    source, index = f"drawn on the panel, from {file.name}", 0
    for segment_data, segment in zip(data["segments"], cam.segments, strict=True):
        if isinstance(segment, DRAWABLE_SEGMENTS):
            count = len(segment.ordinates.numbers)
            values = ordinates[index : index + count].tolist()
            segment_data["ordinates"] = load.quantity_data("assumed", values, "1", source)
            index += count
    if reason is not None:
        data["cannot_be_made"] = reason
    data["segments"] = data.pop("segments")  # move to the end of the file
    load.validate_cam(data)
    header = f"# Drawn with cam-rig panel; dwells and spans are those of {file.name}.\n"
    return header + load.to_yaml(data)


def designed_path(start: Path) -> Path:
    """Return the path to which the optimised cam of a drawn cam is written."""
    return start.with_name(f"{start.stem}_designed.yaml")
