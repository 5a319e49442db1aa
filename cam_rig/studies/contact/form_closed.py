"""Followers that a cam moves both ways: their play between the two contacts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from cam_rig.laws import Law
from cam_rig.profile.curves.closure import closure
from cam_rig.schema import CamConfig, load_cam
from cam_rig.simulation.cam_files import law_of


@dataclass(frozen=True)
class PlayRow:
    """Least and greatest play (m) over the turn of one cam's follower; negative: it jams."""

    cam: CamConfig
    least: float
    greatest: float


def open_form_closed(paths: Iterable[Path]) -> list[tuple[CamConfig, Law]]:
    """Read cam files with their laws.

    Raises
    ------
    ConfigError, LawError : one line that names the file and what is wrong in it
    """
    cams = [(path, load_cam(path)) for path in paths]
    return [(cam, law_of(path, cam)) for path, cam in cams]


def find_play(cams: Iterable[tuple[CamConfig, Law]]) -> list[PlayRow]:
    """The play of each.

    Raises
    ------
    ProfileError, ReachError : a follower of one element, or one that does not reach
    """
    found = [(cam, closure(cam.follower, law)) for cam, law in cams]
    return [PlayRow(cam, float(play.min()), float(play.max())) for cam, play in found]
