"""The report's tables: those of the studies, and those that only a report has."""

from __future__ import annotations

from collections.abc import Callable

from pydantic import BaseModel

from cam_rig.law_design.result import designs_table
from cam_rig.laws import Law
from cam_rig.laws.law import continuity_in_words, extremes
from cam_rig.laws.segments import NAMED_RISES
from cam_rig.paper.contact.comparison import play_table
from cam_rig.paper.orders.study import OrdersResult
from cam_rig.paper.vibration.study import (
    claims_table,
    jump_claims,
)
from cam_rig.report.document import summary_table, table_called
from cam_rig.report.paper import PROPOSED, STEADY_RPM, Findings
from cam_rig.report.paper_reading import misprints_table
from cam_rig.report.sections import origins_table, recorded_table
from cam_rig.report.summary import answers
from cam_rig.show.looks import in_words
from cam_rig.show.tables import Cell, DataTable, Head, tabulate

#: The follower's numbers in Table 1: key there, attribute, heading.
FOLLOWER = (
    ("spring_stiffness_N_per_m", "spring_stiffness", "return spring [N/m]"),
    ("stem_stiffness_N_per_m", "stem_stiffness", "follower stem [N/m]"),
    ("damping_N_s_per_m", "damping", "damping [N·s/m]"),
    ("mass_kg", "mass", "mass [kg]"),
)


def tables(found: Findings) -> dict[str, list[DataTable]]:
    """Every table of the report, by the section that shows it.

    Names are those of files only where the files' numbers are listed.
    """
    titles, listed = titles_of(found), _listed(found)
    return {
        section: some if section == "numbers" else [table_called(table, titles) for table in some]
        for section, some in listed.items()
    }


def titles_of(found: Findings) -> dict[str, str]:
    """What is called otherwise than by its name: rises, the readings of Table 2, cams."""
    sources = found.sources
    rises = {name: in_words(name) for name in NAMED_RISES}
    readings = {name: name.replace("_", " ") for name in sources.readings.readings}
    return rises | readings | sources.cam_set.titles | sources.loaded.titles


def _listed(found: Findings) -> dict[str, list[DataTable]]:
    titles, mounted = found.sources.cam_set.titles, found.sources.loaded.titles
    curves = found.noise.methods[0].curves
    simulated = {cam: curve.level_db for cam, curve in curves.items()}
    printed = {cam: curve.published_db for cam, curve in curves.items()}
    bag = found.sources.recorded
    recorded = [] if bag is None else [recorded_table(bag, simulated, mounted, printed)]
    return {
        "summary": [summary_table(answers(found))],
        "cams": [_table_1(found), _laws(found)],
        "vibration": _vibration(found),
        "flywheel": found.flywheel.to_show(titles) if found.flywheel else [],
        "jump": found.jumps.to_show(titles),
        "readings": found.readings.to_show(),
        "stem": found.stems.to_show(titles),
        "as_cut": [
            *found.cuts.to_show(titles),
            *(found.cut_sizes.to_show(titles) if found.cut_sizes else ()),
        ],
        "timing": _timing(found),
        "contact": found.contact.to_show() + play_table(found.play).to_show(),
        "noise": [*found.noise.to_show(mounted), *recorded],
        "orders": _orders(found),
        "question": found.factorial.to_show(titles),
        "design": designs_table(found.designs).to_show(titles),
        "numbers": [origins_table(name, model) for name, model in files(found).items()],
        "reading": [misprints_table()],
    }


def files(found: Findings) -> dict[str, BaseModel]:
    """Every file with numbers that the report rests on."""
    sources = found.sources
    return {
        f"rig {sources.cam_set.rig.name}": sources.cam_set.rig,
        f"rig {sources.stiff.name}": sources.stiff,
        **{f"cam {name}": cam for name, cam in sources.cam_set.cams.items()},
        **{f"cam {name}": cam for name, cam in sources.loaded.cams.items()},
        f"scene {sources.loaded.scene.name}": sources.loaded.scene,
        f"factorial {sources.factorial.name}": sources.factorial,
        f"readings {sources.readings.name}": sources.readings,
    }


def _timing(found: Findings) -> list[DataTable]:
    """Of all cams the events; of the one that is a single curve the control of them."""
    cams = found.timing.tables()[0].to_show(found.sources.cam_set.titles)
    if found.control is None:
        return cams
    _, ordinates, control, *_ = found.control.tables()
    return cams + control.to_show() + ordinates.to_show()


def _orders(found: Findings) -> list[DataTable]:
    """At the lowest speed, where all keep contact, and at the highest."""
    speeds = [spectrum.rpm for study in found.orders[:1] for spectrum in study.spectra]
    if not speeds:
        return []
    shown = (speeds[0], STEADY_RPM, speeds[-1])
    return OrdersResult(tuple(study.only(*shown) for study in found.orders)).speeds.to_show()


def _table_1(found: Findings) -> DataTable:
    elastic, stiff = found.sources.cam_set.rig, found.sources.stiff
    lift = found.sources.cam_set.cams[PROPOSED].lift.si
    printed = found.sources.tables.table_1
    rows: list[tuple[str, float, float, float]] = [
        (name, printed[key], getattr(stiff.follower, at).si, getattr(elastic.follower, at).si)
        for key, at, name in FOLLOWER
    ]
    return tabulate(
        "The paper's Table 1: parameters",
        [*rows, ("lift [m]", printed["lift_m"], lift, lift)],
        (
            (Head("parameter"), lambda row: row[0]),
            (Head("paper", "", ".6g"), lambda row: row[1]),
            (Head(f"rig {stiff.name}", "", ".6g"), lambda row: row[2]),
            (Head(f"rig {elastic.name}", "", ".6g"), lambda row: row[3]),
        ),
        "The paper prints the mass as 13 kg, a misprint.",
        "Its jump speeds do not come out with the stem it prints; the second rig's stem is "
        "identified from them.",
    )


def _laws(found: Findings) -> DataTable:
    titles = found.sources.cam_set.titles

    def peak(order: int, end: int) -> Callable[[tuple[str, Law]], Cell]:
        return lambda row: extremes(row[1], order)[end].value / row[1].lift

    return tabulate(
        "The laws at their event angles: extremes over the lift",
        found.sources.cam_set.laws.items(),
        (
            (Head("law"), lambda row: titles[row[0]]),
            (Head("continuity"), lambda row: continuity_in_words(row[1])),
            (Head("largest s′", "1/rad", ".3f"), peak(1, 1)),
            (Head("smallest s′", "1/rad", ".3f"), peak(1, 0)),
            (Head("largest s″", "1/rad²", ".2f"), peak(2, 1)),
            (Head("smallest s″", "1/rad²", ".2f"), peak(2, 0)),
        ),
        "Bézier 15 is smoother at its one joint than its ordinates ask for: it is its own mirror "
        "image, so even derivatives meet.",
        "It decelerates less than it accelerates, which raises the jump speed.",
    )


def _vibration(found: Findings) -> list[DataTable]:
    """The measures on either rig, and all claims."""
    cam_set, own, stiff = found.sources.cam_set, found.vibration, found.stiff_vibration
    claims = [*own.claims, *jump_claims(found.jumps.rpm, cam_set.rig.name), *stiff.claims]
    speed = [one.tables()[0].only(STEADY_RPM) for one in (own, stiff)]
    tables = [*speed, claims_table(claims, own.rpm)]
    return [part for table in tables for part in table.to_show(cam_set.titles)]
