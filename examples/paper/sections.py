"""Sections of the report on the paper, in their order."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from matplotlib.figure import Figure

import cam_rig
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.two_masses import REST_DURATION_S
from cam_rig.dynamics.vibration import DEFAULT_WINDOW_RAD
from cam_rig.laws.cam import law_of
from cam_rig.laws.catalogue import rise_families
from cam_rig.profile.cam_checks import MAX_GUIDED_ANGLE, check_cam
from cam_rig.profile.measure import closure
from cam_rig.report.document import Content, Section
from cam_rig.report.sections import laws_table, origins
from cam_rig.simulation.inputs import read_cams
from cam_rig.studies.bounce.motion import IRREGULAR, PERIODIC
from cam_rig.studies.contact import figures as contact_plot
from cam_rig.studies.design import figures as design_plot
from cam_rig.studies.jump import figures as jump_plot
from cam_rig.studies.laws import figures as law_figures
from cam_rig.studies.orders.study import OrdersResult
from cam_rig.studies.profile import figures as profile_plot
from cam_rig.studies.vibration.study import claims_table
from examples.paper import (
    as_cut,
    designs,
    factorial,
    factorial_figure,
    flywheel,
    misprints,
    readings,
    refit,
    stem,
    timing,
)
from examples.paper.common import CAMS, RIG, SCENE, Table
from examples.paper.shared import PROPOSED, Paper, jump_claims, summary_table

#: Cams with other types of follower in the section on contact stress.
CONTACT_CAMS = ("flat", "oscillating_flat", "point")
#: Cams that guide their follower on both sides.
FORM_CLOSED = ("constant_breadth", "constant_diameter", "conjugate", "oscillating_conjugate")
#: Speed (rpm) of the section on contact stress.
CONTACT_RPM = 300.0
#: Roller radius and smallest radius of the nomogram, relative to the lift.
SHARPEST = 2.0
#: Highest order in the Campbell diagrams, whose rays can still be distinguished in print.
SHOWN_ORDERS = 40
#: Dots per inch of these diagrams, whose thousands of lines are an image within the SVG.
ORDERS_DPI = 130
#: First and last speed (rpm) of the bounce map.
BOUNCE_RPM = (300.0, 600.0)
#: Number of speeds of the bounce map.
BOUNCE_SPEEDS = 151
#: Restitution of the bounce map, which is assumed.
RESTITUTION = 0.7
#: Speed (rpm) of figures below all jump speeds.
STEADY_RPM = 300.0
#: Speed (rpm) of figures above all jump speeds except that of Bézier 15.
TAKEOFF_RPM = 460.0
#: Parameters of the follower in table 1: key, attribute of the rig, heading.
FOLLOWER = (
    ("spring_stiffness_N_per_m", "spring_stiffness", "return spring [N/m]"),
    ("stem_stiffness_N_per_m", "stem_stiffness", "follower stem [N/m]"),
    ("damping_N_s_per_m", "damping", "damping [N·s/m]"),
    ("mass_kg", "mass", "mass [kg]"),
)


def _summary(paper: Paper) -> Content:
    return Content([summary_table(paper).for_report])


def table_1(paper: Paper) -> Table:
    """Return table 1 of the paper, with the parameters of both rigs."""
    elastic, stiff = paper.cam_set.rig, paper.stiff
    lift, printed = paper.cam_set.cams[PROPOSED].lift.si, paper.printed.table_1
    rows = [
        (name, printed[key], *(getattr(rig.follower, attribute).si for rig in (stiff, elastic)))
        for key, attribute, name in FOLLOWER
    ]
    return Table(
        "The paper's Table 1: parameters",
        f"parameter | paper :.6g | rig {stiff.name} :.6g | rig {elastic.name} :.6g",
        [*rows, ("lift [m]", printed["lift_m"], lift, lift)],
        "The paper prints the mass as 13 kg, a misprint.\n"
        "Its jump speeds do not come out with the stem it prints; the second rig's stem is "
        "identified from them.",
    )


def _cams(paper: Paper) -> Content:
    cam_set, scene, arcs = paper.cam_set, paper.scene, paper.arcs
    cam, law = cam_set.cams[PROPOSED], cam_set.laws[PROPOSED]
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
        "rises": partial(law_figures.rises_figure, rise_families().values()),
        "cams": partial(law_figures.cams_figure, cam_set.pairs),
        "fig1": partial(law_figures.figure, scene.cams[arcs], scene.laws[arcs]),
        "fig2": partial(law_figures.figure, cam, law),
        "profile": partial(profile_plot.figure, cam, law, check_cam(cam, law)),
    }
    return Content([table_1(paper).for_report, laws], figures)


def _vibration(paper: Paper) -> Content:
    own, stiff, cam_set = paper.vibration, paper.stiff_vibration, paper.cam_set
    claims = [*own.claims, *jump_claims(paper.jumps.rpm, cam_set.rig.name), *stiff.claims]
    speed = [study.tables()[0].select(STEADY_RPM) for study in (own, stiff)]
    moved = float(cam_set.laws[PROPOSED](0.5 * DEFAULT_WINDOW_RAD)) / cam_set.cams[PROPOSED].lift.si
    tables = [*speed, claims_table(claims, own.rpm)]
    return Content(
        [part for table in tables for part in table.to_display(paper.titles)],
        {"fig4": partial(own.plot, rpm=STEADY_RPM)},
        {"moves": moved, "steady_rpm": STEADY_RPM},
    )


def _flywheel(_: Paper) -> Content:
    result, cam = flywheel.study(), flywheel.SHOWN_CAM
    return Content(
        [table.for_report for table in flywheel.tables(result)],
        {"flywheel": partial(flywheel.figure, result)},
        {
            "free": result.turns[cam, flywheel.SHOWN],
            "held": result.turns[cam, math.inf],
            "bare": result.without_preload[cam],
            "shown": flywheel.SHOWN,
        },
    )


def _jump(paper: Paper) -> Content:
    result, cam_set = paper.jumps, paper.cam_set
    printed = [row.published_rpm for row in result.rows if row.published_rpm]
    mean = math.sqrt(sum(x**-2 for x in printed) / len(printed))
    angles = [math.degrees(row.jump.angle) for row in result.rows]
    follower = TwoMassParameters.from_rig(cam_set.rig)
    values = {
        "jump": result.comparison,
        "degrees": refit.jump_by_degree(cam_set.cams[refit.BY_SEGMENTS], follower, REST_DURATION_S),
        "rounded_to": readings.GRID_RPM,
        "rounding": readings.GRID_RPM / math.sqrt(12.0) * mean,
        "angles": (min(angles), max(angles)),
        "takeoff_rpm": TAKEOFF_RPM,
    }
    flights = partial(jump_plot.lift_off_figure, cam_set, TAKEOFF_RPM)
    figures: dict[str, Callable[[], Figure]] = {"jump": result.plot, "fig11": flights}
    return Content(result.to_display(paper.titles), figures, values)


def _bounce(paper: Paper) -> Content:
    """Return the section on bounces of one mass on the TM21's cam.

    The restitution is assumed.
    """
    law, rpm = paper.scene.laws[paper.arcs], np.linspace(*BOUNCE_RPM, BOUNCE_SPEEDS)
    result = cam_rig.bounce_map(law, paper.scene.rig, rpm=rpm, restitution=RESTITUTION, turns=100)
    irregular = [row for row in result.rows if row.motion == IRREGULAR]
    values = {
        "bounce": result,
        "cam": paper.scene.titles[paper.arcs],
        "restitution": RESTITUTION,
        "rest": [row.rpm for row in result.rows if row.comes_to_rest and row.motion == PERIODIC],
        "irregular": irregular,
        "spread": max((row.level_spread_db or 0.0 for row in irregular), default=0.0),
    }
    return Content(result.to_display(paper.titles), {"bounce": result.plot}, values)


def _stem(_: Paper) -> Content:
    result = stem.study()
    soft = result[0]
    tables = [study.over_elements for study in result] + [study.over_cams for study in result]
    frequencies = soft.over_elements.frame["first natural frequency [Hz]"]
    return Content(
        [table.for_report for table in tables],
        {"stem": stem.figure},
        {
            "studies": [(study.stiffness, stem.errors(study)) for study in result],
            "low": 100.0 * (1.0 - frequencies.iloc[0] / frequencies.iloc[-1]),
            "matched": soft.matched,
            "matched_error": stem.matched_error(soft),
        },
    )


def _as_cut(_: Paper) -> Content:
    result = as_cut.study()
    first = result[CAMS.index(as_cut.CUT)]
    title = cam_rig.load_cam(as_cut.CUT).title
    sizes = as_cut.table(as_cut.over_sizes(first), f"{title} as cut, over base and roller radius")
    every = as_cut.table(result, "A roller on the contour that a polar plot of s + R_b gives")
    figures = {"fig12": partial(as_cut.figure, first)}
    return Content([every.for_report, sizes.for_report], figures, {"cut": first})


def _timing(_: Paper) -> Content:
    curves = timing.study()
    tables = timing.events_table(), timing.control_table(curves), timing.ordinates_table(curves[0])
    values = {
        "curves": [
            {
                "free": curve.reaches[curve.free],
                "within": timing.events_in_reach(curve),
                "alone": curve.alone,
            }
            for curve in curves
        ]
    }
    return Content(
        [table.for_report for table in tables], {"timing": partial(timing.figure, curves)}, values
    )


def _contact(paper: Paper) -> Content:
    result = cam_rig.contact_stress(
        [*CAMS, *CONTACT_CAMS], RIG, CONTACT_RPM, pressure_angle=MAX_GUIDED_ANGLE
    )
    rows = []
    for path, cam in read_cams(FORM_CLOSED):
        play = 1e9 * closure(cam.follower, law_of(path, cam))
        rows.append((cam.title, cam.follower.type.replace("_", " "), play.min(), play.max()))
    table = Table(
        "Play between the two contacts over the turn, each element put on its finished contour",
        "cam | follower | least [nm] :.1e | greatest [nm] :.1e",
        rows,
        "Negative: the follower would jam. The contours are splines through 3600 points.",
    )
    return Content(
        [*result.to_display(paper.titles), table.for_report],
        {
            "contact": result.plot,
            "events": partial(contact_plot.events_figure, MAX_GUIDED_ANGLE, SHARPEST),
        },
        {"contact": result},
    )


def _noise(paper: Paper) -> Content:
    result = paper.noise
    tables = result.to_display(paper.titles)
    values = {"best": result.best, "why": result.high_dwell, "levels": tables[-1]}
    return Content(tables, {"fig16": result.plot}, values)


def _orders(paper: Paper) -> Content:
    """Return the section on orders, at three speeds.

    They are the lowest speed, at which all cams are in contact, the speed of the figures, and the
    highest speed.
    """
    result = cam_rig.order_spectrum(SCENE, paper.scene.scene.schedule.speeds.numbers).studies
    rpm = [spectrum.rpm for spectrum in result[0].spectra]
    shown_orders = OrdersResult(tuple(study.only(rpm[0], STEADY_RPM, rpm[-1]) for study in result))
    drawn = OrdersResult(tuple(study.up_to(SHOWN_ORDERS) for study in result), paper.scene.titles)
    return Content(
        shown_orders.speeds.to_display(paper.titles),
        {"orders": drawn.plot},
        {"studies": result, "steady_rpm": STEADY_RPM},
        dpi=ORDERS_DPI,
    )


def _question(paper: Paper) -> Content:
    result = paper.factorial
    elastic, stiff = (study.at(STEADY_RPM) for study in (paper.vibration, paper.stiff_vibration))
    stiffer = (elastic[cam].residual_amplitude / stiff[cam].residual_amplitude for cam in elastic)
    tables = [table.for_report for table in factorial.tables(result)]
    values = {
        "classes": result.same_angles.classes,
        "stiffer": min(stiffer),
        "advantage": [table for table in tables if table.caption.startswith("Advantage")],
    }
    return Content(tables, {"factorial": partial(factorial_figure.figure, result)}, values)


def _design(paper: Paper) -> Content:
    result = designs.paper_designs(paper.cam_set)
    tables = [designs.table(result).for_report] if result else []
    figures = {"best": partial(design_plot.figure, result[0])} if result else {}
    return Content(tables, figures, {"designs": result, "cut": PROPOSED})


def _readings(paper: Paper) -> Content:
    tables = [table.for_report for table in readings.tables(paper.readings)]
    rows = [row for study in paper.readings for row in study.rows]
    half_turns = [30.0 / row.jump for row in rows]
    limit = [abs(row.at_jump - readings.TABLE_2[row.cam][1]) for row in rows]
    apart = [abs(row.at_jump - row.beyond) for row in rows]
    values = {
        "rounded_to": readings.GRID_RPM,
        "printed": readings.TABLE_2,
        "widest": max(row.window for row in rows),
        "limit_times": sum(x <= half for x, half in zip(limit, half_turns, strict=True)),
        "moved": sum(not x < half for x, half in zip(apart, half_turns, strict=True)),
    }
    return Content(tables, values=values)


def _numbers(paper: Paper) -> Content:
    rigs = {f"rig {rig.name}": rig for rig in (paper.cam_set.rig, paper.stiff)}
    cams = {f"cam {name}": cam for name, cam in (paper.cam_set.cams | paper.scene.cams).items()}
    others = {f"reading {name}": study for name, study in paper.readings_by_name.items()}
    scene = {f"scene {paper.scene.scene.name}": paper.scene.scene}
    return origins({**rigs, **cams, **scene, **others})


def _reading(_: Paper) -> Content:
    return Content([misprints.table().for_report])


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
