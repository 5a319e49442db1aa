"""State of the drawing board: cam, rig, drawing, and data of its page.

The drawing consists of the ordinates, the base radius and the speed. The ordinates are the control
values of the Bézier or B-spline segments of the law, as fractions of the lift. A person moves them
on the curve.
"""

from __future__ import annotations

import io
import shlex
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

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
from cam_rig.panel.board.drawable import DRAWABLE_SEGMENTS, with_base_radius
from cam_rig.panel.board.drawn_law import DrawnLaw, law_data
from cam_rig.panel.board.evaluation import evaluate_fast, fatal_reasons, has_flywheel
from cam_rig.panel.board.figures import find_rise, law_figures
from cam_rig.schema import CamConfig, RigConfig, load, load_rig
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
#: Smallest accepted base radius, mm.
MIN_BASE_RADIUS_MM = 0.01
#: Largest accepted base radius, mm.
MAX_BASE_RADIUS_MM = 1e4


class Board:
    """Drawing board of a cam on a rig, whose law has movable ordinates.

    The ordinates are the control values of the segments. `rig_name` is the rig's name in commands.
    Files are written to `out`. Pages choose from `cams` and `rigs`: the shipped files, the files
    with which the board started, and opened cams. A later file replaces an earlier one of its name.
    """

    def __init__(
        self, cam: CamConfig, rig: RigConfig, out: Path, rig_name: str | None = None
    ) -> None:
        self.rig, self.out = rig, out
        self.cams, self.rigs = shipped_cams() | {cam.name: cam}, shipped_rigs() | {rig.name: rig}
        self._rig_names = {rig.name: rig.name if rig_name is None else rig_name}
        self.rpm, self.version, self.generation = START_RPM, 0, 0
        self._draw(cam, DrawnLaw.of(cam))

    def _draw(self, cam: CamConfig, drawn: DrawnLaw) -> None:
        self.file, self.drawn, self.ordinates = cam, drawn, drawn.ordinates
        self.base_radius_mm = self._start_base_mm = 1e3 * cam.follower.base_radius.si
        self._free = np.array([handle.index for handle in drawn.handles], dtype=np.intp)
        self._rise = find_rise(cam, build_law(cam))

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
        self.cams[cam.name] = cam
        self._count_machine()

    def choose(self, cam: Any, rig: Any) -> None:
        """Replace the cam or the rig of the board by another of `cams` or `rigs`.

        `cam` and `rig` are names, or None for the present one. The drawing of a cam ends if another
        is chosen. Raises ConfigError for another name or a cam that cannot be drawn, DynamicsError
        for a rig with numbers out of range. The board is then unchanged.
        """
        new_cam = None if cam is None else _named("cam", cam, self.cams)
        new_rig = self.rig if rig is None else _named("rig", rig, self.rigs)
        FollowerParameters.from_rig(new_rig)
        if new_cam is not None:
            self._draw(new_cam, DrawnLaw.of(new_cam))
        self.rig = new_rig
        self._count_machine()

    def _count_machine(self) -> None:
        """Count a new cam or rig, so that a page of the previous one can be detected."""
        self.version += 1
        self.generation += 1

    @property
    def cam(self) -> CamConfig:
        """Cam whose ordinates and base radius are changed on the board.

        The other sizes of its follower, its spans and its dwells are fixed.
        """
        return self._cam_with(self.base_radius_mm)

    def _cam_with(self, base_radius_mm: float) -> CamConfig:
        if base_radius_mm == self._start_base_mm:
            return self.drawn.start.cam
        return with_base_radius(self.drawn.start.cam, base_radius_mm, self.file.name)

    @property
    def machine(self) -> tuple[DrawnLaw, RigConfig]:
        """Drawn cam and rig, which are compared to detect that one of them has been replaced."""
        return self.drawn, self.rig

    def law(self, ordinates: FloatArray | None = None) -> Law:
        """Return the law with the given ordinates ``(m,)`` (default: those of the board)."""
        return self.drawn.law(self.ordinates if ordinates is None else ordinates, self.cam.name)

    def update(self, ordinates: Any, rpm: Any, base_radius_mm: Any = None) -> None:
        """Apply ordinates, speed (rpm) and base radius (mm) from a page to the board.

        The fixed ordinates at the ends of segments do not change. The default base radius is the
        present one. Raises RefusedError for invalid values.
        """
        valid, base = self._validate(ordinates), self._validate_base(base_radius_mm)
        if not (is_number(rpm) and MIN_RPM <= rpm <= MAX_RPM):
            raise RefusedError(f"rpm: is {rpm!r:.40}; allowed: {MIN_RPM:g} to {MAX_RPM:g}")
        self.ordinates, self.rpm, self.base_radius_mm = valid, float(rpm), base
        self.version += 1

    def _validate_base(self, value: Any) -> float:
        if value is None:
            return self.base_radius_mm
        if not (is_number(value) and MIN_BASE_RADIUS_MM <= value <= MAX_BASE_RADIUS_MM):
            low, high = f"{MIN_BASE_RADIUS_MM:g}", f"{MAX_BASE_RADIUS_MM:g}"
            raise RefusedError(f"base radius: is {value!r:.40}; allowed: {low} to {high} mm")
        return float(value)

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

        They are the contours, their faults and the jump speed, see `evaluation.evaluate_fast`, the
        figures of the law, see `figures.law_figures`, and the version of the board.
        """
        law = self.law()
        results = {"version": self.version, "figures": law_figures(law, self._rise)}
        return results | evaluate_fast(self.cam, law, self.rig)

    def page_data(self) -> dict[str, Any]:
        """Return the data of the board that a page needs once.

        They contain names, numbers of the rig, the movable ordinates, and the linear map from the
        ordinates to the law.
        """
        start, cam = self.drawn.start, self.drawn.start.cam
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
            "generation": self.generation,
            "base_radius_mm": self.base_radius_mm,
            "base_radius_range": [MIN_BASE_RADIUS_MM, MAX_BASE_RADIUS_MM],
            "rig": {
                "name": self.rig.name,
                "title": self.rig.title,
                "mass": follower.mass,
                "damping": follower.damping,
                "spring_stiffness": follower.spring_stiffness,
                "preload": follower.preload,
                "restitution": follower.restitution,
                "two_masses": describe_follower(follower_of(self.rig)) == TWO_MASSES,
                "from_rest_s": REST_DURATION_S,
                "has_shaft": self.rig.shaft is not None,
                "has_flywheel": has_flywheel(self.rig),
                # empty if the level of one mass is only relative
                "calibrated_on": self.rig.calibrated_on if calibrated else "",
            },
            "rpm": self.rpm,
            "rpm_range": [MIN_RPM, MAX_RPM],
            "ordinates": self.ordinates.tolist(),
            "start": self.drawn.ordinates.tolist(),
            "start_base_radius_mm": self._start_base_mm,
            "handles": [asdict(handle) for handle in self.drawn.handles],
            "cams": {cam.name: cam.title for cam in sorted(self.cams.values(), key=_title)},
            "rigs": {name: self.rigs[name].title for name in sorted(self.rigs)},
            "law": self.drawn.page_data,
        }

    def second_law(self, name: str) -> dict[str, Any]:
        """Return the law of one of `cams` for comparison, see `law_for_comparison`."""
        cam = _named("cam", name, self.cams)
        return law_for_comparison(cam, build_law(cam))

    def save(self, name: Any, ordinates: Any, base_radius_mm: Any = None) -> Path:
        """Write a cam file with the given ordinates and base radius, and return its path.

        The default base radius is that of the board. If a cam with this law cannot be made, the
        file contains the reason.
        """
        path = self.out / f"{require_name(name)}.yaml"
        write_new(self.out, {path.name: self._file_text(path.stem, ordinates, base_radius_mm)})
        return path

    def cam_of(self, name: str, ordinates: Any, base_radius_mm: Any = None) -> CamConfig:
        """Return the cam that `save` writes, without writing a file."""
        text = self._file_text(name, ordinates, base_radius_mm)
        return CamConfig.model_validate(parse_yaml(text))

    def _file_text(self, name: str, ordinates: Any, base_radius_mm: Any) -> str:
        valid = self._validate(ordinates)
        cam = self._cam_with(self._validate_base(base_radius_mm))
        reason = "; ".join(fatal_reasons(cam, self.law(valid))) or None
        return cam_text(name, cam, self.file, valid, reason)

    def save_for_page(
        self, name: Any, ordinates: Any, base_radius_mm: Any = None
    ) -> dict[str, Any]:
        """Write a cam file as `save`, and return data on the file.

        The data are the path, the command that optimises the cam (cam-rig design), and the reason
        if the cam cannot be made.
        """
        path = self.save(name, ordinates, base_radius_mm)
        arguments = ["cam-rig", "design", str(path), "--maximise", GOAL, "--limit", LIMIT]
        rig = self._rig_names.get(self.rig.name, self.rig.name)
        arguments += ["--rig", rig, "--out", str(designed_path(path))]
        return {
            "path": str(path),
            "command": shlex.join(arguments),
            "cannot_be_made": load_cam(path).cannot_be_made,
        }

    def dxf(self, ordinates: Any, base_radius_mm: Any = None) -> str:
        """Return the contour of the cam that `save` writes as text of a DXF file.

        Lengths are in mm. `cam-rig profile --out` writes the same file. Raises ProfileError if the
        cam cannot be made.
        """
        cam = self._cam_with(self._validate_base(base_radius_mm))
        law = self.law(self._validate(ordinates))
        for library in ("ezdxf", "shapely"):
            require(library)
        if reasons := fatal_reasons(cam, law):
            raise ProfileError(f"cannot be made: {'; '.join(reasons)}")
        from cam_rig.profile.drawing_files import to_document
        from cam_rig.profile.polyline import contour_paths, polyline

        curves, text = contour_paths(cam.follower, law), io.StringIO()
        to_document({curve.name: polyline(curve, CHORD_ERROR) for curve in curves}).write(text)
        return text.getvalue()


#: Cam or rig.
Named = TypeVar("Named", CamConfig, RigConfig)

# Output of the board: cam file, contour as DXF, and command of a design from the drawn cam.

#: Largest distance of the DXF's chords from the contour, m.
CHORD_ERROR = 1e-6
#: Quantity that is maximised when a drawn cam is optimised with `cam-rig design`.
GOAL = "jump_speed"
#: Limit of that optimisation: the peak acceleration must not exceed that of the drawn cam.
LIMIT = "peak_acceleration<=start"


@cache
def shipped_cams() -> dict[str, CamConfig]:
    """Return the shipped cams by their names."""
    return {cam.name: cam for cam in map(load_cam, (config_root() / "cams").glob("*.yaml"))}


@cache
def shipped_rigs() -> dict[str, RigConfig]:
    """Return the shipped rigs by their names."""
    return {rig.name: rig for rig in map(load_rig, (config_root() / "rigs").glob("*.yaml"))}


def _title(cam: CamConfig) -> str:
    return cam.title.lower()


def _named(kind: str, name: Any, choices: dict[str, Named]) -> Named:
    """Return the cam or rig (`kind`) that a page has named, or raise ConfigError."""
    if not (isinstance(name, str) and name in choices):
        raise ConfigError(f"{kind}: is {name!r:.40}; allowed: {', '.join(sorted(choices))}")
    return choices[name]


def law_for_comparison(cam: CamConfig, law: Law) -> dict[str, Any]:
    """Return a law that a page compares with that of the board, with the title of its cam."""
    return {
        "title": cam.title,
        "law": law_data(law),
        "figures": law_figures(law, find_rise(cam, law)),
    }


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
