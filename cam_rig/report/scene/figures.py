"""The figures of a scene's page."""

from __future__ import annotations

from cam_rig.plots import jump as jump_plot
from cam_rig.plots import law as law_plot
from cam_rig.plots import law_overlay
from cam_rig.plots import motion as motion_plot
from cam_rig.plots import profile as profile_plot
from cam_rig.plots import vibration as vibration_plot
from cam_rig.plots.sound import noise as noise_plot
from cam_rig.plots.sound import orders as orders_plot
from cam_rig.report.figures import uri
from cam_rig.report.scene.results import SceneFindings, force_curves
from cam_rig.studies.jump.contact_lost_speed import FROM_REST

#: Cams whose law and contour are drawn, at most.
MOST_CAMS = 6


def figures(found: SceneFindings) -> dict[str, str]:
    """URIs by key; those of a study that could not be made are missing."""
    run, loaded, whole = found.run, found.loaded, found.cam_set
    curves = force_curves(run)
    drawn = {
        "force": uri(lambda path: motion_plot.draw_over_turn(curves, path)),
        "noise": uri(lambda path: noise_plot.draw(run.noise, loaded, path)),
    }
    if len(whole.cams) > 1:
        laws = [(whole.cams[cam], law) for cam, law in whole.laws.items()]
        drawn["cams"] = uri(lambda path: law_overlay.draw_cams(laws, path))
    if found.jumps:
        drawn["jump"] = uri(lambda path: jump_plot.draw(found.jumps, whole, FROM_REST, path))
    if found.vibration is not None:
        rpm, cams = found.vibration.rpm[-1], found.drawn(list(found.vibration.measures))
        drawn["vibration"] = uri(lambda path: vibration_plot.draw(cams, rpm, path))
    if found.orders:
        drawn["orders"] = uri(lambda path: orders_plot.draw(found.orders, path, whole.titles))
    return drawn | _of_cams(found)


def _of_cams(found: SceneFindings) -> dict[str, str]:
    """Law and contour of each cam."""
    drawn: dict[str, str] = {}
    for name in list(found.loaded.cams)[:MOST_CAMS]:
        drawn |= _of_cam(found, name)
    return drawn


def _of_cam(found: SceneFindings, name: str) -> dict[str, str]:
    cam, law = found.loaded.cams[name], found.loaded.laws[name]
    drawn = {f"law_{name}": uri(lambda path: law_plot.draw(cam, law, path))}
    if (checks := found.checks.get(name)) is not None:
        drawn[f"profile_{name}"] = uri(lambda path: profile_plot.draw(cam, law, checks, path))
    return drawn
