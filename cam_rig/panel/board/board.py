"""The state of the drawing board: cam, rig, ordinates and speed, and what a page needs of them."""

from __future__ import annotations

import base64
import math
from pathlib import Path
from typing import Any

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import FollowerParameters
from cam_rig.errors import ConfigError, OutputError, RefusedError
from cam_rig.laws import Law, build_law
from cam_rig.panel.board.drawable import DRAWN
from cam_rig.panel.board.drawn_law import ORDERS, POINTS, DrawnLaw, table_angles
from cam_rig.panel.board.exact import at_once
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import NAME, Library, config_root, load_cam
from cam_rig.studies.cam_fit.cam_file import quantity, to_yaml, valid_cam
from cam_rig.studies.design.cam_file import without_empty
from cam_rig.studies.jump.any_rig import TWO_MASSES, described, follower_of
from cam_rig.studies.jump.contact_lost_speed import FROM_REST

#: Speeds (rpm) that the board takes, and the one it begins with.
MIN_RPM, MAX_RPM, START_RPM = 1.0, 1e5, 300.0
#: An ordinate is no farther from zero than this many lifts: what a cam file takes.
MAX_ORDINATE = 100.0


class Board:
    """A drawing board; it outlives the pages that show it.

    Parameters
    ----------
    cam : the start
    rig : on which it runs
    out : folder that cam files are saved in

    Raises
    ------
    ConfigError : a cam that rests all around or does not join itself; a rig that splits its mass
        only half
    LawError : the cam has no law
    """

    def __init__(self, cam: CamConfig, rig: RigConfig, out: Path) -> None:
        self.rig, self.out, self.file = rig, out, cam
        self.drawn = DrawnLaw.of(cam)
        self.ordinates, self.rpm, self.version = self.drawn.ordinates, START_RPM, 0
        self._free = np.array([handle.index for handle in self.drawn.handles], dtype=np.intp)
        self._two_masses = described(follower_of(rig)) == TWO_MASSES

    @property
    def cam(self) -> CamConfig:
        """The cam that the ordinates are drawn on: its follower, spans and dwells stay."""
        return self.drawn.start.cam

    def law(self, ordinates: FloatArray | None = None) -> Law:
        """The law of some ordinates ``(m,)``, of the board's own by default."""
        return self.drawn.law(self.ordinates if ordinates is None else ordinates, self.cam.name)

    def take(self, ordinates: Any, rpm: Any) -> None:
        """A change of a page; the ends of segments stay as they are.

        Raises
        ------
        RefusedError : other than as many numbers as there are ordinates, or out of range
        """
        self.ordinates, self.rpm = self._allowed(ordinates), _speed(rpm)
        self.version += 1

    def _allowed(self, given: Any) -> FloatArray:
        count = self.ordinates.size
        if not (isinstance(given, list) and len(given) == count and all(map(_is_number, given))):
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
        own = FollowerParameters.from_rig(self.rig)
        return {
            "cam": {
                "name": self.file.name,
                "title": self.file.title,
                "lift_m": start.cam.lift.si,
                "sprung": start.cam.follower.sprung,
            },
            "class": None if start.law_class is None else start.law_class.words,
            "distance_m": start.distance,
            "rig": {
                "name": self.rig.name,
                "title": self.rig.title,
                "mass": own.mass,
                "damping": own.damping,
                "spring_stiffness": own.spring_stiffness,
                "preload": own.preload,
                "two_masses": self._two_masses,
                "from_rest_s": FROM_REST,
                "calibrated_on": self.rig.radiation.calibrated_on,
            },
            "rpm": self.rpm,
            "rpm_range": [MIN_RPM, MAX_RPM],
            "version": self.version,
            "ordinates": self.ordinates.tolist(),
            "start": self.drawn.ordinates.tolist(),
            "handles": [{"index": h.index, "angle": h.angle} for h in self.drawn.handles],
            "cams": sorted(path.stem for path in (config_root() / "cams").glob("*.yaml")),
            "points": POINTS,
            "orders": ORDERS,
            "first": _base64(table.first),
            "table": _base64(table.table),
            "constant": _base64(table.constant),
        }

    def other(self, name: str) -> dict[str, Any]:
        """The law of a shipped cam, to be shown beside: ``(4, n)`` m/rad^order, as base64.

        Raises
        ------
        ConfigError : no such cam
        """
        law = build_law(load_cam(Library((config_root(),)).path("cams", name)))
        motion = np.stack([law(table_angles(), order) for order in range(ORDERS)])
        return {"name": name, "motion": _base64(motion)}

    def save(self, name: Any, ordinates: Any) -> Path:
        """Write ordinates as a cam file into the folder; gives its path.

        Raises
        ------
        RefusedError : wrong ordinates
        ConfigError : not a name
        OutputError : there is such a file already, or it cannot be written
        """
        if not (isinstance(name, str) and NAME.fullmatch(name)):
            raise ConfigError(
                "name: allowed: up to 100 small letters, digits and _, a letter first"
            )
        text, path = self._text(name, self._allowed(ordinates)), self.out / f"{name}.yaml"
        try:
            self.out.mkdir(parents=True, exist_ok=True)
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
        except FileExistsError:
            raise OutputError(
                f"{path}: exists already, not overwriting; name another or move it"
            ) from None
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror})") from None
        return path

    def _text(self, name: str, ordinates: FloatArray) -> str:
        data = self.cam.model_dump(exclude_none=True)
        data |= {"name": name, "title": f"{self.file.title}, drawn"}
        data.pop("cannot_be_made", None)
        data.pop("identified_from", None)
        source, at = f"drawn on the panel, from {self.file.name}", 0
        for part, segment in zip(data["segments"], self.cam.segments, strict=True):
            if isinstance(segment, DRAWN):
                count = len(segment.ordinates.numbers)
                own = ordinates[at : at + count].tolist()
                part["ordinates"] = quantity("assumed", own, "1", source)
                at += count
        plain = {key: without_empty(x) if isinstance(x, dict) else x for key, x in data.items()}
        plain["segments"] = [without_empty(part) for part in data["segments"]]
        valid_cam(plain)
        return f"# Drawn with cam-rig panel; dwells and spans are those of {self.file.name}.\n" + (
            to_yaml(plain)
        )


def _is_number(given: Any) -> bool:
    return isinstance(given, int | float) and not isinstance(given, bool) and math.isfinite(given)


def _speed(rpm: Any) -> float:
    """A speed (rpm) of a page.

    Raises
    ------
    RefusedError : out of range
    """
    if not (_is_number(rpm) and MIN_RPM <= rpm <= MAX_RPM):
        raise RefusedError(f"rpm: is {rpm!r:.40}; allowed: {MIN_RPM:g} to {MAX_RPM:g}")
    return float(rpm)


def _base64(array: FloatArray) -> str:
    """As little-endian float64, row by row."""
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f8").tobytes()).decode("ascii")
