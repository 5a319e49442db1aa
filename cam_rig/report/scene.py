"""All findings about a scene: what each study gives for its cams on its rig, or why it cannot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from cam_rig.errors import CamRigError, ConfigError
from cam_rig.laws import figures as law_figures
from cam_rig.laws.cam import CamSet
from cam_rig.paper.jump import figures as jump_plot
from cam_rig.paper.jump.comparison import JumpResult, find_jumps
from cam_rig.paper.noise.roles import StudyRoles
from cam_rig.paper.orders import figures as orders_plot
from cam_rig.paper.orders.spectrum import CamOrders, waterfall
from cam_rig.paper.orders.study import OrdersResult
from cam_rig.paper.vibration import figures as vibration_plot
from cam_rig.paper.vibration.study import VibrationResult, measure
from cam_rig.profile import figures as profile_plot
from cam_rig.profile.check_table import check_cam
from cam_rig.profile.checks import Check
from cam_rig.report.paper import uris
from cam_rig.report.sections import Recorded, read_recorded
from cam_rig.simulation import figures as simulation_figures
from cam_rig.simulation.figures import force_curves
from cam_rig.simulation.scene import ORDER_SPEEDS, VIBRATION_SPEEDS, LoadedScene, speeds_of, spread
from cam_rig.simulation.scene_run import SceneRun, run_scene
from cam_rig.units import NS, RPM

Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class SceneFindings:
    """What a scene's page shows.

    Parameters
    ----------
    run : the simulated scene, with its rows by speed and its levels
    checks : of each cam's contour
    jumps, vibration, orders : of the cams that a study could take
    refused : by section, what a study said of a cam it could not take
    recorded : a bag of the scene
    """

    run: SceneRun
    checks: dict[str, list[Check]]
    jumps: JumpResult
    vibration: VibrationResult | None
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
        jumps=JumpResult(
            CamSet(loaded.cams, loaded.laws, loaded.rig),
            tuple(row for one in tried("jump", studies.jump).values() for row in one.rows),
        ),
        vibration=_joined(tried("vibration", studies.vibration), loaded),
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

    def alone(self, cam: str) -> CamSet:
        loaded = self.loaded
        return CamSet({cam: loaded.cams[cam]}, {cam: loaded.laws[cam]}, loaded.rig)

    def jump(self, cam: str) -> JumpResult:
        return find_jumps(self.alone(cam), {})

    def vibration(self, cam: str) -> VibrationResult:
        return measure(self.alone(cam), spread(speeds_of(self.loaded), VIBRATION_SPEEDS))

    def orders(self, cam: str) -> CamOrders:
        loaded = self.loaded
        speeds = [rpm * RPM for rpm in spread(speeds_of(loaded), ORDER_SPEEDS)]
        laws = {cam: loaded.laws[cam]}
        return waterfall(laws, loaded.scene.model, loaded.rig, speeds)[0]


def _joined(found: dict[str, VibrationResult], loaded: LoadedScene) -> VibrationResult | None:
    """Results of one cam each as one; None for none."""
    if not found:
        return None
    cams, laws = {cam: loaded.cams[cam] for cam in found}, {cam: loaded.laws[cam] for cam in found}
    rows = tuple(row for one in found.values() for row in one.rows)
    return VibrationResult(CamSet(cams, laws, loaded.rig), rows)


def rig_seconds(run: SceneRun) -> float:
    """How long the scene is, s of the rig's time."""
    return run.ticks[-1].stop_ns / NS


# The figures of a scene's page.

#: Cams whose law and contour are drawn, at most.
MOST_CAMS = 6


def figures(found: SceneFindings) -> dict[str, list[str]]:
    """URIs by key; those of a study that could not be made are missing."""
    run, whole = found.run, found.cam_set
    curves = force_curves(run)
    drawn = {
        "force": uris(simulation_figures.over_turn(curves)),
        "noise": uris(simulation_figures.figure(run)),
    }
    if len(whole.cams) > 1:
        laws = [(whole.cams[cam], law) for cam, law in whole.laws.items()]
        drawn["cams"] = uris(law_figures.cams_figure(laws))
    if found.jumps.rows:
        drawn["jump"] = uris(jump_plot.figure(found.jumps))
    if found.vibration is not None:
        drawn["vibration"] = uris(vibration_plot.figure(found.vibration))
    if found.orders:
        drawn["orders"] = uris(orders_plot.figure(OrdersResult(found.orders, whole.titles)))
    return drawn | _of_cams(found)


def _of_cams(found: SceneFindings) -> dict[str, list[str]]:
    """Law and contour of each cam."""
    drawn: dict[str, list[str]] = {}
    for name in list(found.loaded.cams)[:MOST_CAMS]:
        drawn |= _of_cam(found, name)
    return drawn


def _of_cam(found: SceneFindings, name: str) -> dict[str, list[str]]:
    cam, law = found.loaded.cams[name], found.loaded.laws[name]
    drawn = {f"law_{name}": uris(law_figures.figure(cam, law))}
    if (checks := found.checks.get(name)) is not None:
        drawn[f"profile_{name}"] = uris(profile_plot.figure(cam, law, checks))
    return drawn
