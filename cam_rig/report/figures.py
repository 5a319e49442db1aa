"""The report's figures, drawn as SVG and carried in the page itself."""

from __future__ import annotations

import base64

from matplotlib.figure import Figure

from cam_rig.dynamics import TwoMassParameters
from cam_rig.files import no_room, temporary_folder
from cam_rig.laws.catalogue import families
from cam_rig.plots import as_cut as as_cut_plot
from cam_rig.plots import contact as contact_plot
from cam_rig.plots import factorial as factorial_plot
from cam_rig.plots import jump as jump_plot
from cam_rig.plots import lift_off as takeoff_plot
from cam_rig.plots import limits
from cam_rig.plots import profile as profile_plot
from cam_rig.plots import timing as timing_plot
from cam_rig.plots import vibration as vibration_plot
from cam_rig.plots.laws import one_law as law_plot
from cam_rig.plots.laws import overlay as law_overlay
from cam_rig.plots.sound import noise_study as noise_study_plot
from cam_rig.plots.sound import orders as orders_plot
from cam_rig.profile.checks.all_checks import check_cam
from cam_rig.profile.checks.pressure_angle import GUIDED
from cam_rig.report.results import CUT, Findings, Sources
from cam_rig.report.strips import strips, write_strip
from cam_rig.studies.jump.comparison import JumpRow
from cam_rig.studies.jump.contact_lost_speed import FROM_REST
from cam_rig.studies.stem.chain import Stem
from cam_rig.studies.vibration.claims import LOWER

#: Speeds of the figures, rpm: below every jump speed, and above all but Bézier 15's.
STEADY_RPM, TAKEOFF_RPM = 300.0, 460.0
#: Roller and least radius of the contour in the nomogram, in lifts.
SHARPEST = 2.0
PROPOSED = "bezier15"
#: Highest order of the Campbell diagrams, whose rays stay apart on paper.
SHOWN_ORDERS = 40
#: Dots per inch of their thousands of strokes, which are pixels within the SVG.
ORDERS_DPI = 130


def uris(figure: Figure, dpi: float | None = None) -> list[str]:
    """A figure's strips as SVG, from the top, each a data URI that repeats bit for bit.

    ``dpi`` is of what is made of pixels.

    Raises
    ------
    OutputError : there is no room for it, or no file may have its size
    """
    found = []
    for low, high in strips(figure):
        with temporary_folder() as folder:
            path = folder / "figure.svg"
            try:
                write_strip(figure, low, high, path, dpi)
            except OSError as error:
                raise no_room(folder, error) from None
            text = path.read_text(encoding="utf-8")
        kept = [line for line in text.splitlines() if "<dc:date>" not in line]
        data = base64.b64encode("\n".join(kept).encode()).decode()
        found.append(f"data:image/svg+xml;base64,{data}")
    return found


def early_figures(sources: Sources, jumps: list[JumpRow]) -> dict[str, list[str]]:
    """Those that need no study: URIs by key."""
    cam_set, arcs = sources.cam_set, _arc_cam(sources)
    cam, law = cam_set.cams[PROPOSED], cam_set.laws[PROPOSED]
    tm21, tm21_law = sources.loaded.cams[arcs], sources.loaded.laws[arcs]
    checks = check_cam(cam, law)
    shown = [(cam_set.cams[name], curve) for name, curve in cam_set.laws.items()]
    return {
        "rises": uris(law_overlay.rises_figure(families().values())),
        "cams": uris(law_overlay.cams_figure(shown)),
        "fig1": uris(law_plot.figure(tm21, tm21_law)),
        "fig2": uris(law_plot.figure(cam, law)),
        "fig4": uris(vibration_plot.figure(cam_set, STEADY_RPM)),
        "fig11": uris(takeoff_plot.figure(cam_set, TAKEOFF_RPM)),
        "profile": uris(profile_plot.figure(cam, law, checks)),
        "jump": uris(jump_plot.figure(jumps, cam_set, FROM_REST)),
    }


def late_figures(found: Findings) -> dict[str, list[str]]:
    """Those of the studies."""
    sources, noise, factorial = found.sources, found.noise, found.factorial
    return {
        "contact": uris(contact_plot.figure(found.contact)),
        "events": uris(contact_plot.events_figure(GUIDED, SHARPEST)),
        "fig16": uris(noise_study_plot.figure(noise, sources.loaded)),
        "factorial": uris(factorial_plot.figure(factorial)),
    }


def flywheel_figures(found: Findings) -> dict[str, list[str]]:
    """That of the flywheel; none for a rig without a shaft."""
    study, titles = found.flywheel, found.sources.cam_set.titles
    if study is None:
        return {}
    return {"flywheel": uris(limits.flywheel_figure(study, titles))}


def stem_figures(found: Findings) -> dict[str, list[str]]:
    """That of the stem in more and more masses."""
    cam_set = found.sources.cam_set
    stem = Stem(TwoMassParameters.from_rig(cam_set.rig), 1.0)
    law, title = cam_set.laws[LOWER], cam_set.titles[LOWER]
    return {"stem": uris(limits.stem_figure(law, title, stem))}


def cut_figures(found: Findings) -> dict[str, list[str]]:
    """Fig. 12, where its cam has a roller."""
    cut, titles = found.cuts.get(CUT), found.sources.cam_set.titles
    if cut is None:
        return {}
    return {"fig12": uris(as_cut_plot.figure(cut, titles[CUT]))}


def timing_figures(found: Findings) -> dict[str, list[str]]:
    """What the ordinates move, where a cam is one Bézier curve."""
    columns = [control.timing for control in found.control]
    return {"timing": uris(timing_plot.figure(columns))} if columns else {}


def order_figures(found: Findings) -> dict[str, list[str]]:
    """Orders over speed, where the scene's model has them."""
    if not found.orders:
        return {}
    shown = [study.up_to(SHOWN_ORDERS) for study in found.orders]
    titles = found.sources.loaded.titles
    return {"orders": uris(orders_plot.figure(shown, titles), ORDERS_DPI)}


def _arc_cam(sources: Sources) -> str:
    """The scene's identified cam, which stands in for the TM21's own."""
    loaded = sources.loaded
    return next(cam for cam in loaded.cams if loaded.part(cam) == "identified")
