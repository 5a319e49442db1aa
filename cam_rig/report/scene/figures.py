"""The figures of a scene's page."""

from __future__ import annotations

from cam_rig.plots import jump as jump_plot
from cam_rig.plots import motion as motion_plot
from cam_rig.plots import profile as profile_plot
from cam_rig.plots import vibration as vibration_plot
from cam_rig.plots.laws import one_law as law_plot
from cam_rig.plots.laws import overlay as law_overlay
from cam_rig.plots.sound import noise as noise_plot
from cam_rig.plots.sound import orders as orders_plot
from cam_rig.report.figures import uris
from cam_rig.report.scene.results import SceneFindings, force_curves
from cam_rig.studies.jump.contact_lost_speed import FROM_REST

#: Cams whose law and contour are drawn, at most.
MOST_CAMS = 6


def figures(found: SceneFindings) -> dict[str, list[str]]:
    """URIs by key; those of a study that could not be made are missing."""
    run, loaded, whole = found.run, found.loaded, found.cam_set
    curves = force_curves(run)
    drawn = {
        "force": uris(motion_plot.over_turn(curves)),
        "noise": uris(noise_plot.figure(run.noise, loaded)),
    }
    if len(whole.cams) > 1:
        laws = [(whole.cams[cam], law) for cam, law in whole.laws.items()]
        drawn["cams"] = uris(law_overlay.cams_figure(laws))
    if found.jumps:
        drawn["jump"] = uris(jump_plot.figure(found.jumps, whole, FROM_REST))
    if found.vibration is not None:
        rpm, cams = found.vibration.rpm[-1], found.drawn(list(found.vibration.measures))
        drawn["vibration"] = uris(vibration_plot.figure(cams, rpm))
    if found.orders:
        drawn["orders"] = uris(orders_plot.figure(found.orders, whole.titles))
    return drawn | _of_cams(found)


def _of_cams(found: SceneFindings) -> dict[str, list[str]]:
    """Law and contour of each cam."""
    drawn: dict[str, list[str]] = {}
    for name in list(found.loaded.cams)[:MOST_CAMS]:
        drawn |= _of_cam(found, name)
    return drawn


def _of_cam(found: SceneFindings, name: str) -> dict[str, list[str]]:
    cam, law = found.loaded.cams[name], found.loaded.laws[name]
    drawn = {f"law_{name}": uris(law_plot.figure(cam, law))}
    if (checks := found.checks.get(name)) is not None:
        drawn[f"profile_{name}"] = uris(profile_plot.figure(cam, law, checks))
    return drawn
