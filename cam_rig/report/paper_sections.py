"""The sections of the paper's report, in the order they are read at its end."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from cam_rig.dynamics.jump.two_masses import FROM_REST
from cam_rig.dynamics.vibration import STAND_IN
from cam_rig.laws.catalogue import families
from cam_rig.paper.as_cut import study as as_cut
from cam_rig.paper.as_cut.study import CUT
from cam_rig.paper.flywheel import FLYWHEEL_RPM, study_flywheel
from cam_rig.paper.flywheel import SHOWN as FLYWHEEL_SHOWN
from cam_rig.paper.stem.study import STEM_RPM, study_stems
from cam_rig.paper.timing.study import TimingResult
from cam_rig.profile.cam_checks import GUIDED, check_cam
from cam_rig.report.document import Content, Section
from cam_rig.report.paper import Paper, answers, misprints_table
from cam_rig.report.sections import laws_table, origins, recorded_table
from cam_rig.show.tables import DataTable, Header
from cam_rig.studies.bounce.motion import IRREGULAR, PERIODIC
from cam_rig.studies.bounce.study import bounce_map
from cam_rig.studies.contact import figures as contact_plot
from cam_rig.studies.contact.study import compare_contacts, play_table
from cam_rig.studies.design import figures as design_plot
from cam_rig.studies.design.result import designs_table
from cam_rig.studies.design.study import paper_designs
from cam_rig.studies.jump import figures as jump_plot
from cam_rig.studies.jump.comparison import BY_SEGMENTS, jump_by_degree
from cam_rig.studies.jump.study import ROUNDED_TO
from cam_rig.studies.laws import figures as law_figures
from cam_rig.studies.noise import calibration, methods
from cam_rig.studies.orders.spectrum import waterfall
from cam_rig.studies.orders.steady_force import BUILDERS
from cam_rig.studies.orders.study import OrdersResult
from cam_rig.studies.profile import figures as profile_plot
from cam_rig.studies.vibration.study import PROPOSED, claims_table, jump_claims

TITLE = "Cam rig: the paper's experiments, redone and taken further"
#: What is drawn at random.
SEEDS = (
    f"{methods.SEED} (bootstrap of the noise study, {methods.DRAWS} draws), "
    f"{calibration.SEED} (starts of its transfer functions, {calibration.STARTS})"
)

#: Speed of the contact study, rpm.
CONTACT_RPM = 300.0
#: Roller and least radius of the contour in the nomogram, in lifts.
SHARPEST = 2.0
#: Highest order of the Campbell diagrams, whose rays stay apart on paper, and dots per inch of
#: their thousands of strokes, which are pixels within the SVG.
SHOWN_ORDERS, ORDERS_DPI = 40, 130
#: Speeds of the bounce map, from and to (rpm) and how many; a restitution that no source prints.
BOUNCE_RPM, BOUNCE_SPEEDS, RESTITUTION = (300.0, 600.0), 151, 0.7
#: Speeds of the figures, rpm: below every jump speed, and above all but Bézier 15's.
STEADY_RPM, TAKEOFF_RPM = 300.0, 460.0
#: The follower's numbers in Table 1: key there, attribute, heading.
FOLLOWER = (
    ("spring_stiffness_N_per_m", "spring_stiffness", "return spring [N/m]"),
    ("stem_stiffness_N_per_m", "stem_stiffness", "follower stem [N/m]"),
    ("damping_N_s_per_m", "damping", "damping [N·s/m]"),
    ("mass_kg", "mass", "mass [kg]"),
)


def _summary(paper: Paper) -> Content:
    return Content(values={"answers": list(answers(paper))})


def _cams(paper: Paper) -> Content:
    cam_set, mounted = paper.cam_set, paper.loaded
    cam, law = cam_set.cams[PROPOSED], cam_set.laws[PROPOSED]
    arcs = next(name for name in mounted.cams if mounted.fitted_origin(name) == "identified")
    laws = laws_table(
        "The laws at their event angles: extremes over the lift",
        cam_set,
        {1: ".3f", 2: ".2f"},
        "Bézier 15 is smoother at its one joint than its ordinates ask for: it is its own mirror "
        "image, so even derivatives meet.",
        "It decelerates less than it accelerates, which raises the jump speed.",
        over_lift=True,
    )
    figures = {
        "rises": partial(law_figures.rises_figure, families().values()),
        "cams": partial(law_figures.cams_figure, cam_set.pairs),
        "fig1": partial(law_figures.figure, mounted.cams[arcs], mounted.laws[arcs]),
        "fig2": partial(law_figures.figure, cam, law),
        "profile": partial(profile_plot.figure, cam, law, check_cam(cam, law)),
    }
    return Content([_table_1(paper), laws], figures)


def _table_1(paper: Paper) -> DataTable:
    elastic, stiff = paper.cam_set.rig, paper.stiff
    lift = paper.cam_set.cams[PROPOSED].lift.si
    printed = paper.tables.table_1
    rows = [
        (name, printed[key], getattr(stiff.follower, at).si, getattr(elastic.follower, at).si)
        for key, at, name in FOLLOWER
    ]
    notes = (
        "The paper prints the mass as 13 kg, a misprint.",
        "Its jump speeds do not come out with the stem it prints; the second rig's stem is "
        "identified from them.",
    )
    names = ("paper", f"rig {stiff.name}", f"rig {elastic.name}")
    heads = (Header("parameter"), *(Header(name, "", ".6g") for name in names))
    every = (*rows, ("lift [m]", printed["lift_m"], lift, lift))
    return DataTable("The paper's Table 1: parameters", heads, every, notes)


def _vibration(paper: Paper) -> Content:
    """The measures on either rig, and all claims."""
    own, stiff, cam_set = paper.vibration, paper.stiff_vibration, paper.cam_set
    claims = [*own.claims, *jump_claims(paper.jumps.rpm, cam_set.rig.name), *stiff.claims]
    speed = [one.tables()[0].select(STEADY_RPM) for one in (own, stiff)]
    moved = float(cam_set.laws[PROPOSED](0.5 * STAND_IN)) / cam_set.cams[PROPOSED].lift.si
    tables = [*speed, claims_table(claims, own.rpm)]
    return Content(
        [part for table in tables for part in table.to_display(paper.titles)],
        {"fig4": partial(own.plot, rpm=STEADY_RPM)},
        {"moves": moved, "steady_rpm": STEADY_RPM},
        {"vibration": own},
    )


def _flywheel(paper: Paper) -> Content:
    found = study_flywheel(paper.cam_set, FLYWHEEL_RPM)
    return Content(
        found.to_display(paper.titles) if found else [],
        {"flywheel": found.plot} if found else {},
        {"flywheel": found, "shown": FLYWHEEL_SHOWN, "infinity": math.inf},
    )


def _jump(paper: Paper) -> Content:
    found, cam_set = paper.jumps, paper.cam_set
    printed = [row.published_rpm for row in found.rows if row.published_rpm]
    mean = math.sqrt(sum(x**-2 for x in printed) / len(printed))
    angles = [math.degrees(row.found.angle) for row in found.rows]
    values = {
        "jump": found.comparison,
        "degrees": jump_by_degree(cam_set.cams[BY_SEGMENTS], paper.parameters, FROM_REST),
        "rounded_to": ROUNDED_TO,
        "rounding": ROUNDED_TO / math.sqrt(12.0) * mean,
        "angles": (min(angles), max(angles)),
        "takeoff_rpm": TAKEOFF_RPM,
    }
    flights = partial(jump_plot.lift_off_figure, cam_set, TAKEOFF_RPM)
    figures: dict[str, Callable[[], Figure]] = {"jump": found.plot, "fig11": flights}
    return Content(found.to_display(paper.titles), figures, values, {"jump": found})


def _readings(paper: Paper) -> Content:
    return Content(paper.readings.to_display(paper.titles), values={"rounded_to": ROUNDED_TO})


def _stem(paper: Paper) -> Content:
    found = study_stems(paper.cam_set, paper.stems, STEM_RPM)
    tables = found.to_display(paper.titles)
    return Content(tables, {"stem": found.plot}, {"studies": found.studies})


def _bounce(paper: Paper) -> Content:
    """Of the cam that the rig's own is taken for, one mass with a restitution that is assumed."""
    loaded = paper.loaded
    cam = next((name for name in loaded.cams if loaded.fitted_origin(name) == "identified"), None)
    if cam is None or loaded.laws[cam].velocity_jumps:
        return Content(values={"bounce": None})
    rpm = np.linspace(*BOUNCE_RPM, BOUNCE_SPEEDS)
    found = bounce_map(loaded.laws[cam], loaded.rig, rpm=rpm, restitution=RESTITUTION, turns=100)
    irregular = [row for row in found.rows if row.motion == IRREGULAR]
    values = {
        "bounce": found,
        "cam": loaded.titles[cam],
        "restitution": RESTITUTION,
        "rest": [row.rpm for row in found.rows if row.rests and row.motion == PERIODIC],
        "irregular": irregular,
        "spread": max((row.level_spread_db or 0.0 for row in irregular), default=0.0),
    }
    return Content(
        found.to_display(paper.titles), {"bounce": found.plot}, values, {"bounce": found}
    )


def _as_cut(paper: Paper) -> Content:
    """Cams with rollers as they were cut, and `CUT` over its radii."""
    cam_set, bench = paper.cam_set, as_cut.CutBench.of(paper.cam_set.rig, paper.loaded)
    rollers = [cam for cam, config in cam_set.cams.items() if as_cut.has_central_roller(config)]
    cuts = as_cut.cut_all(cam_set.only(rollers), bench)
    tables, cut = cuts.to_display(paper.titles), cuts.of(CUT)
    if cut is not None:
        title = cam_set.titles[CUT]
        sizes = as_cut.BASES, as_cut.ROLLERS
        tables += as_cut.over_sizes(cut, bench, *sizes, title).to_display(paper.titles)
    return Content(
        tables,
        {"fig12": partial(cuts.plot, cam=CUT)} if cut else {},
        {"cut": cut},
        {"as-cut": cuts},
    )


def _timing(paper: Paper) -> Content:
    """Of all cams the events; of `CUT`, where it is a single curve, the control of them."""
    cam_set = paper.cam_set
    found = TimingResult.of(cam_set.pairs)
    tables = found.tables()[0].to_display(paper.titles)
    one = TimingResult.of(cam_set.only([CUT]).pairs) if CUT in cam_set.cams else None
    if one is None or not one.control:
        return Content(tables, values={"control": []}, results={"timing": found})
    _, ordinates, control, *_ = one.tables()
    tables += control.to_display() + ordinates.to_display()
    return Content(tables, {"timing": one.plot}, {"control": one.control}, {"timing": found})


def _contact(paper: Paper) -> Content:
    found = compare_contacts(paper.touching, CONTACT_RPM, GUIDED)
    play = play_table(paper.form_closed)
    return Content(
        found.to_display(paper.titles) + play.to_display(paper.titles),
        {"contact": found.plot, "events": partial(contact_plot.events_figure, GUIDED, SHARPEST)},
        {"contact": found},
        {"contact": found},
    )


def _noise(paper: Paper) -> Content:
    found, bag, titles = paper.noise, paper.recorded, paper.loaded.titles
    tables, recorded = found.to_display(paper.titles), []
    if bag is not None:
        curves = found.methods[0].curves
        simulated = {cam: curve.level_db for cam, curve in curves.items()}
        printed = {cam: curve.published_db for cam, curve in curves.items()}
        recorded = [recorded_table(bag, simulated, titles, printed)]
    values = {
        "best": found.best,
        "why": found.high_dwell,
        "levels": tables[-1],
        "recorded": recorded,
    }
    return Content([*tables, *recorded], {"fig16": found.plot}, values, {"noise": found})


def _orders(paper: Paper) -> Content:
    """Tables are of the lowest speed, where all keep contact, of the figures', and the highest."""
    loaded, scene = paper.loaded, paper.loaded.scene
    speeds = sorted(scene.program.speeds.si_list)
    if scene.model not in BUILDERS:
        return Content(values={"studies": ()}, results={"orders": None})
    found = waterfall(loaded.laws, scene.model, loaded.rig, speeds)
    rpm = [spectrum.rpm for spectrum in found[0].spectra]
    shown = OrdersResult(tuple(one.only(rpm[0], STEADY_RPM, rpm[-1]) for one in found))
    drawn = OrdersResult(tuple(one.up_to(SHOWN_ORDERS) for one in found), loaded.titles)
    return Content(
        shown.speeds.to_display(paper.titles),
        {"orders": drawn.plot},
        {"studies": found, "steady_rpm": STEADY_RPM},
        {"orders": OrdersResult(found)},
        ORDERS_DPI,
    )


def _question(paper: Paper) -> Content:
    found = paper.factorial
    elastic, stiff = (one.at(STEADY_RPM) for one in (paper.vibration, paper.stiff_vibration))
    stiffer = (elastic[cam].residual_amplitude / stiff[cam].residual_amplitude for cam in elastic)
    (advantage,) = (table for table in found.tables() if table.key == "advantage")
    values = {
        "classes": found.same_angles.classes,
        "stiffer": min(stiffer),
        "advantage": advantage.to_display(paper.titles),
    }
    tables, figures = found.to_display(paper.titles), {"factorial": found.plot}
    return Content(tables, figures, values, {"factorial": found})


def _design(paper: Paper) -> Content:
    found = paper_designs(paper.cam_set)
    tables = designs_table(found).to_display(paper.titles)
    figures = {"best": partial(design_plot.figure, found[0])} if found else {}
    return Content(tables, figures, {"designs": found, "cut": CUT})


def _numbers(paper: Paper) -> Content:
    rigs = {f"rig {rig.name}": rig for rig in (paper.cam_set.rig, paper.stiff)}
    shown = {f"cam {name}": cam for name, cam in (paper.cam_set.cams | paper.loaded.cams).items()}
    others = {
        f"scene {paper.loaded.scene.name}": paper.loaded.scene,
        f"factorial {paper.asked.name}": paper.asked,
        f"readings {paper.table_readings.name}": paper.table_readings,
    }
    return origins({**rigs, **shown, **others})


def _reading(paper: Paper) -> Content:
    return Content(misprints_table().to_display())


SECTIONS = (
    Section("summary", "In short", _summary, late=True),
    Section("cams", "Cams and laws", _cams),
    Section("vibration", "Residual and torsional vibration", _vibration),
    Section("flywheel", "A flywheel that does not hold its speed", _flywheel),
    Section("jump", "Jump speed", _jump),
    Section("bounce", "Bouncing above the jump speed", _bounce),
    Section("stem", "Where two masses stop being enough", _stem),
    Section("as_cut", "The cam as it was cut", _as_cut),
    Section("timing", "Timing of the events", _timing),
    Section("contact", "Contact pressure and sliding", _contact),
    Section("noise", "Noise", _noise, late=True),
    Section("orders", "Orders of force and sound", _orders),
    Section("question", "Continuity or lower slopes", _question, late=True),
    Section("design", "What a better law could reach", _design),
    Section("readings", "The paper's Table 2 read in other ways", _readings, aside=True),
    Section("numbers", "Given, assumed, identified", _numbers, aside=True),
    Section("reading", "How the paper was read, and how this was made", _reading, aside=True),
)
