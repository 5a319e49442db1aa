"""All findings about a scene: what each study gives for its cams on its rig, or why it cannot."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np

from cam_rig.api.scene_run import SceneRun, run_scene
from cam_rig.errors import CamRigError, ConfigError
from cam_rig.plots.motion import ForceCurve
from cam_rig.profile.checks.all_checks import check_cam
from cam_rig.profile.checks.check import Check
from cam_rig.report.recorded import Recorded, read_recorded
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.studies.cam_set import CamSet
from cam_rig.studies.jump.any_rig import described, described_run, find_jump, follower_of
from cam_rig.studies.jump.comparison import JumpRow
from cam_rig.studies.jump.contact_lost_speed import FROM_REST
from cam_rig.studies.noise.setup import StudyRoles
from cam_rig.studies.orders.waterfall import CamOrders, waterfall
from cam_rig.studies.vibration.comparison import VibrationTable, vibration_table
from cam_rig.units import NS, RPM, to_rpm

Found = TypeVar("Found")
#: Speeds at most of the vibration tables, of the force over the turn, and of the orders.
VIBRATION_SPEEDS, FORCE_SPEEDS, ORDER_SPEEDS = 4, 5, 13


@dataclass(frozen=True, eq=False)
class SceneFindings:
    """What a scene's page shows.

    Parameters
    ----------
    run : the simulated scene, with its rows by speed and its levels
    checks : of each cam's contour
    jumps : of the cams that have a jump speed; ``follower`` says of two masses or of one
    vibration, orders : of the cams that a study could take
    refused : by section, what a study said of a cam it could not take
    recorded : a bag of the scene
    """

    run: SceneRun
    checks: dict[str, list[Check]]
    jumps: list[JumpRow]
    vibration: VibrationTable | None
    orders: tuple[CamOrders, ...]
    recorded: Recorded | None = None
    refused: dict[str, list[str]] = field(default_factory=dict)

    @property
    def loaded(self) -> LoadedScene:
        """The scene with everything it names."""
        return self.run.loaded

    @property
    def cam_set(self) -> CamSet:
        """Its cams on its rig, as the studies take them."""
        return CamSet(self.loaded.cams, self.loaded.laws, self.loaded.rig)

    @property
    def follower(self) -> str:
        """Of which follower the jump speeds are."""
        return described(follower_of(self.loaded.rig))

    @property
    def jump_run(self) -> str:
        """Of which follower the jump speeds are, and in which run of it."""
        return described_run(follower_of(self.loaded.rig), FROM_REST)

    def drawn(self, cams: list[str]) -> CamSet:
        """The set of some of the cams."""
        whole = self.cam_set
        return CamSet(
            {cam: whole.cams[cam] for cam in cams},
            {cam: whole.laws[cam] for cam in cams},
            whole.rig,
        )


def is_papers(loaded: LoadedScene) -> bool:
    """Whether a scene is the paper's noise study, on the rig that was calibrated for it."""
    try:
        StudyRoles.of(loaded)
    except ConfigError:
        return False
    return loaded.published is not None and loaded.calibrated


def find_scene(
    loaded: LoadedScene, bag: Path | None, on_part: Callable[[str], None] = lambda _: None
) -> SceneFindings:
    """Run a scene and every study of its cams.

    Parameters
    ----------
    bag : a recording of the scene to compare with
    on_part : told each part as it begins

    Raises
    ------
    CamRigError : the bag is of another scene, or no settled turn is run; what a study cannot take
        is among the findings instead
    """
    recorded = None if bag is None else read_recorded(bag, loaded)
    on_part("the run")
    run = run_scene(loaded)
    on_part("studies")
    refused: dict[str, list[str]] = {}

    def tried(section: str, study: Callable[[str], Found]) -> dict[str, Found]:
        found = {}
        for cam in loaded.cams:
            try:
                found[cam] = study(cam)
            except CamRigError as error:
                refused.setdefault(section, []).append(f"{loaded.cams[cam].title}: {error}")
        return found

    studies = _Studies(loaded)
    return SceneFindings(
        run=run,
        checks=tried("contour", studies.checks),
        jumps=list(tried("jump", studies.jump).values()),
        vibration=_joined(list(tried("vibration", studies.vibration).values())),
        orders=tuple(tried("sound", studies.orders).values()),
        recorded=recorded,
        refused=refused,
    )


@dataclass(frozen=True)
class _Studies:
    """The studies of one cam of a scene each."""

    loaded: LoadedScene

    def checks(self, cam: str) -> list[Check]:
        return check_cam(self.loaded.cams[cam], self.loaded.laws[cam])

    def jump(self, cam: str) -> JumpRow:
        follower = follower_of(self.loaded.rig)
        return JumpRow(cam, find_jump(self.loaded.laws[cam], follower, FROM_REST))

    def vibration(self, cam: str) -> VibrationTable:
        loaded = self.loaded
        one = CamSet({cam: loaded.cams[cam]}, {cam: loaded.laws[cam]}, loaded.rig)
        return vibration_table(one, tuple(spread(speeds_of(loaded), VIBRATION_SPEEDS)))

    def orders(self, cam: str) -> CamOrders:
        loaded = self.loaded
        speeds = [rpm * RPM for rpm in spread(speeds_of(loaded), ORDER_SPEEDS)]
        laws = {cam: loaded.laws[cam]}
        return waterfall(laws, loaded.scene.model, loaded.rig, speeds)[0]


def _joined(tables: list[VibrationTable]) -> VibrationTable | None:
    """Tables of one cam each as one; None for none."""
    if not tables:
        return None
    measures = {cam: row for table in tables for cam, row in table.measures.items()}
    lost = {cam: rpm for table in tables for cam, rpm in table.contact_lost_rpm.items()}
    return VibrationTable(tables[0].rpm, measures, lost)


def speeds_of(loaded: LoadedScene) -> list[float]:
    """The scene's speeds (rpm), each once, rising."""
    return sorted({round(to_rpm(speed), 9) for speed in loaded.scene.program.speeds.si_list})


def spread(speeds: list[float], most: int) -> list[float]:
    """So many of the speeds at most, the first and the last among them.

    Examples
    --------
    >>> spread([1.0, 2.0, 3.0, 4.0, 5.0], 3)
    [1.0, 3.0, 5.0]
    """
    if len(speeds) <= most:
        return speeds
    return [speeds[i] for i in np.linspace(0, len(speeds) - 1, most).round().astype(int).tolist()]


def force_curves(run: SceneRun) -> dict[str, list[ForceCurve]]:
    """The contact force over the last turn at some of the speeds, by the cam's title."""
    scene = run.loaded.scene
    shown = spread(speeds_of(run.loaded), FORCE_SPEEDS)
    last: dict[str, dict[float, deque[tuple[np.ndarray, np.ndarray]]]] = {}
    for tick in run.blocks():
        rpm = next((speed for speed in shown if tick.is_of(None, speed)), None)
        if rpm is not None:
            ticks = last.setdefault(tick.cam, {})
            ticks.setdefault(rpm, deque(maxlen=scene.program.ticks_per_turn)).append(
                (tick.angle_in_turn, tick.force)
            )
    return {
        run.loaded.cams[cam].title: [
            _over_turn(rpm, ticks) for rpm, ticks in sorted(by_speed.items())
        ]
        for cam, by_speed in last.items()
    }


def _over_turn(rpm: float, ticks: deque[tuple[np.ndarray, np.ndarray]]) -> ForceCurve:
    """The samples of a turn by rising angle."""
    angle = np.concatenate([angles for angles, _ in ticks])
    order = np.argsort(angle, kind="stable")
    return rpm, np.degrees(angle[order]), np.concatenate([forces for _, forces in ticks])[order]


def rig_seconds(run: SceneRun) -> float:
    """How long the scene is, s of the rig's time."""
    return run.ticks[-1].stop_ns / NS
