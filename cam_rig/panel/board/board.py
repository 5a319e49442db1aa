"""The state of the drawing board: cam, rig, ordinates and speed, and what a page needs of them."""

from __future__ import annotations

import io
import shlex
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.any_follower import TWO_MASSES, described, follower_of
from cam_rig.dynamics.jump.two_masses import FROM_REST
from cam_rig.errors import ConfigError, ProfileError, RefusedError
from cam_rig.extras import require
from cam_rig.files import write_new
from cam_rig.laws import Law, build_law
from cam_rig.panel import is_number
from cam_rig.panel.bench.drawing import cam_picture
from cam_rig.panel.board.drawable import DRAWN, at_once, failing
from cam_rig.panel.board.drawn_law import ORDERS, POINTS, DrawnLaw, in_base64, motion_in_base64
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.explain import explain
from cam_rig.schema.load import (
    NAME,
    Library,
    config_root,
    file_data,
    load_cam,
    quantity,
    to_yaml,
    valid_cam,
)
from cam_rig.schema.segments import BSpline
from cam_rig.schema.yaml_text import parse_yaml
from cam_rig.simulation.scene import is_calibrated
from cam_rig.units import FloatArray

#: Speeds (rpm) that the board takes, and the one it begins with.
MIN_RPM, MAX_RPM, START_RPM = 1.0, 1e5, 300.0
#: An ordinate is no farther from zero than this many lifts: what a cam file takes.
MAX_ORDINATE = 100.0


class Board:
    """A cam drawn on a rig (commands take it as ``rig_name``); files go to ``out``."""

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
        """Draw on from a cam file's text; what is no such file is refused, and changes nothing."""
        if not isinstance(text, str):
            raise RefusedError("text: is missing; allowed: a cam file's")
        try:
            cam = CamConfig.model_validate(parse_yaml(text))
        except ValidationError as error:
            raise ConfigError(f"no cam file: {explain(error, CamConfig)}") from None
        self._draw(cam, DrawnLaw.of(cam))
        self.version += 1

    @property
    def cam(self) -> CamConfig:
        """The cam that the ordinates are drawn on: its follower, spans and dwells stay."""
        return self.drawn.start.cam

    def law(self, ordinates: FloatArray | None = None) -> Law:
        """The law of some ordinates ``(m,)``, of the board's own by default."""
        return self.drawn.law(self.ordinates if ordinates is None else ordinates, self.cam.name)

    def take(self, ordinates: Any, rpm: Any) -> None:
        """A change of a page; the ends of segments stay as they are."""
        self.ordinates, self.rpm = self._allowed(ordinates), _speed(rpm)
        self.version += 1

    def _allowed(self, given: Any) -> FloatArray:
        count = self.ordinates.size
        if not (isinstance(given, list) and len(given) == count and all(map(is_number, given))):
            raise RefusedError(f"ordinates: allowed: a list of {count} numbers")
        found = self.drawn.ordinates.copy()
        found[self._free] = np.array(given, dtype=np.float64)[self._free]
        if not np.abs(found).max() <= MAX_ORDINATE:
            raise RefusedError(f"ordinates: allowed: -{MAX_ORDINATE:g} to {MAX_ORDINATE:g} lifts")
        return found

    def at_once(self) -> dict[str, Any]:
        """What the board's law comes to, see `exact.at_once`."""
        return {"version": self.version} | at_once(self.cam, self.law(), self.rig)

    def page(self) -> dict[str, Any]:
        """All that a page needs once: names, numbers of the rig, handles, the motion's table."""
        start, table = self.drawn.start, self.drawn.table
        pivot = getattr(start.cam.follower, "pivot_distance", None)
        own = FollowerParameters.from_rig(self.rig)
        calibrated = is_calibrated(self.rig, "one_mass")
        return {
            "cam": {
                "name": self.file.name,
                "lift_m": start.cam.lift.si,
                "sprung": start.cam.follower.sprung,
            },
            "drawn_as": self._drawn_as(),
            "distance_m": start.distance,
            "start_made": not at_once(self.cam, start.law, self.rig)["faults"],
            "follower": {
                "roller_mm": 1e3 * start.cam.follower.roller,
                "pivot_mm": None if pivot is None else 1e3 * pivot.si,
            },
            "picture": cam_picture(start.cam, start.law),
            "rig": {
                "name": self.rig.name,
                "mass": own.mass,
                "damping": own.damping,
                "spring_stiffness": own.spring_stiffness,
                "preload": own.preload,
                "two_masses": described(follower_of(self.rig)) == TWO_MASSES,
                "from_rest_s": FROM_REST,
                # where the level of one mass is not relative
                "calibrated_on": self.rig.calibrated_on if calibrated else "",
            },
            "rpm": self.rpm,
            "rpm_range": [MIN_RPM, MAX_RPM],
            "version": self.version,
            "ordinates": self.ordinates.tolist(),
            "start": self.drawn.ordinates.tolist(),
            "handles": [asdict(handle) for handle in self.drawn.handles],
            "cams": sorted(path.stem for path in (config_root() / "cams").glob("*.yaml")),
            "points": POINTS,
            "orders": ORDERS,
            "first": in_base64(table.first),
            "table": in_base64(table.table),
            "constant": in_base64(table.constant),
        }

    def _drawn_as(self) -> dict[str, Any] | None:
        """The B-splines that stand for the file's law; None where the ordinates are its own."""
        start = self.drawn.start
        degrees = [s.degree for s in start.cam.segments if isinstance(s, BSpline)]
        return None if start.own else {"degree": max(degrees), "exact": start.exact}

    def other(self, name: str) -> dict[str, Any]:
        """The law of a shipped cam, to be shown beside: ``(4, n)`` m/rad^order, as base64."""
        law = build_law(load_cam(Library((config_root(),)).path("cams", name)))
        return {"name": name, "motion": motion_in_base64(law)}

    def save(self, name: Any, ordinates: Any) -> Path:
        """Write ordinates as a cam file; of a law that cannot be made it says so, and why."""
        path = self.out / f"{require_name(name)}.yaml"
        write_new(self.out, {path.name: self._text(path.stem, ordinates)})
        return path

    def drawn_cam(self, name: str, ordinates: Any) -> CamConfig:
        """The cam of some ordinates, without a file."""
        return CamConfig.model_validate(parse_yaml(self._text(name, ordinates)))

    def _text(self, name: str, ordinates: Any) -> str:
        own = self._allowed(ordinates)
        why_not = "; ".join(failing(self.cam, self.law(own))[0]) or None
        return cam_text(name, self.cam, self.file, own, why_not)

    def saved(self, name: Any, ordinates: Any) -> dict[str, Any]:
        """What a page is told of a file that it saved."""
        path = self.save(name, ordinates)
        words = ("cam-rig", "design", str(path), "--maximise", GOAL, "--limit", LIMIT)
        command = shlex.join([*words, "--rig", self.rig_name, "--out", str(designed_path(path))])
        return {"path": str(path), "command": command, "why_not": load_cam(path).cannot_be_made}

    def dxf(self, ordinates: Any) -> str:
        """The contour of some ordinates in mm, as `cam-rig profile --out` writes it."""
        cam, law = self.cam, self.law(self._allowed(ordinates))
        for library in ("ezdxf", "shapely"):
            require(library)
        if why := failing(cam, law)[0]:
            raise ProfileError(f"cannot be made: {'; '.join(why)}")
        from cam_rig.profile.drawing_files import to_document
        from cam_rig.profile.polyline import contour_paths, polyline

        curves, text = contour_paths(cam.follower, law), io.StringIO()
        to_document({curve.name: polyline(curve, CHORD_ERROR) for curve in curves}).write(text)
        return text.getvalue()


def _speed(rpm: Any) -> float:
    if not (is_number(rpm) and MIN_RPM <= rpm <= MAX_RPM):
        raise RefusedError(f"rpm: is {rpm!r:.40}; allowed: {MIN_RPM:g} to {MAX_RPM:g}")
    return float(rpm)


# What the board writes: the cam's file, the contour as DXF, and the command that designs on.

#: Largest distance (m) of the DXF's chords from the contour.
CHORD_ERROR = 1e-6
#: What a design from the board is to reach, and to keep.
GOAL, LIMIT = "jump_speed", "peak_acceleration<=start"


def require_name(name: Any) -> str:
    """What a cam may be called."""
    if not (isinstance(name, str) and NAME.fullmatch(name)):
        raise ConfigError("name: allowed: up to 100 small letters, digits and _, a letter first")
    return name


def cam_text(
    name: str, cam: CamConfig, file: CamConfig, ordinates: FloatArray, why_not: str | None
) -> str:
    """The file of a drawn cam with other ordinates ``(m,)``; it says why it cannot be made."""
    data = file_data(cam) | {"name": name, "title": f"{file.title}, drawn"}
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
    data["segments"] = data.pop("segments")  # to the end
    valid_cam(data)
    head = f"# Drawn with cam-rig panel; dwells and spans are those of {file.name}.\n"
    return head + to_yaml(data)


def designed_path(start: Path) -> Path:
    """Where a design from a saved cam is written."""
    return start.with_name(f"{start.stem}_designed.yaml")
