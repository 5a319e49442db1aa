"""The page of a scene: the same layout as the paper's page, with sections of its own."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

from pydantic import BaseModel

from cam_rig.laws import Law
from cam_rig.laws.law import continuity_in_words as continuity
from cam_rig.laws.law import extremes
from cam_rig.paper.orders.spectrum import HIGHEST
from cam_rig.paper.orders.study import OrdersResult
from cam_rig.profile.check_table import CheckedCam, ProfileResult
from cam_rig.report.document import Answer, Document, Made, bold, render, span, summary_table
from cam_rig.report.scene import SceneFindings, rig_seconds
from cam_rig.report.sections import origins_table, recorded_table
from cam_rig.schema.quantity import ORIGINS
from cam_rig.schema.segment_base import quantities
from cam_rig.show.tables import Cell, DataTable, Head, tabulate
from cam_rig.simulation.scene import RELATIVE_NOTE, speeds_of

# A scene's page in short: what each cam does on its rig, as questions and answers.


def answers(found: SceneFindings) -> Iterator[Answer]:
    """What the page has to say, in the order of its sections."""
    if found.checks:
        yield _checks(found)
    yield from _contact(found)
    yield from _jumps(found)
    yield _levels(found)


def _checks(found: SceneFindings) -> Answer:
    checks = [check for row in found.checks.values() for check in row]
    failed = sum(not check.passed for check in checks)
    return Answer(
        "Do the contours pass their checks?",
        f"{bold(len(checks) - failed)} of {bold(len(checks))} pass",
        f"{failed} fail{'s' if failed == 1 else ''}" if failed else "all pass",
    )


def _contact(found: SceneFindings) -> Iterator[Answer]:
    """Of each cam: where it loses contact, and the longest flight."""
    for cam in found.loaded.cams:
        rows = [row for row in found.run.by_speed if row.cam == cam]
        off = [row for row in rows if row.flight > 0.0]
        pulled = [row for row in rows if row.force_least < 0.0]
        asked = f"Does the follower keep contact with {found.cam_set.titles[cam]}?"
        if off:
            longest = max(off, key=lambda row: row.flight)
            first = min(row.rpm for row in off)
            yield Answer(
                asked,
                f"lost at {bold(len(off))} of {bold(len(rows))} speeds, first at "
                f"{bold(first, '.6g', 'rpm')}; the longest flight lasts "
                f"{bold(1e3 * longest.flight, '.1f', 'ms')}, at {bold(longest.rpm, '.6g', 'rpm')}",
                "contact is lost",
            )
        elif pulled:
            yield Answer(
                asked,
                f"the model holds it, and pulls at {bold(len(pulled))} of {bold(len(rows))} speeds",
                "contact would be lost",
            )
        else:
            yield Answer(asked, f"kept at {bold(len(rows))} of {bold(len(rows))} speeds", "kept")


def _jumps(found: SceneFindings) -> Iterator[Answer]:
    fastest = speeds_of(found.loaded)[-1]
    for row in found.jumps.rows:
        where = "below" if row.found.rpm < fastest else "above"
        yield Answer(
            f"What is the jump speed of {found.cam_set.titles[row.cam]}?",
            f"{bold(row.found.rpm, '.1f', 'rpm')} ({found.jumps.run}); contact is lost at "
            f"**{math.degrees(row.found.angle):.1f}°**",
            f"{where} the scene's fastest speed",
        )


def _levels(found: SceneFindings) -> Answer:
    levels = [row.level_db for row in found.run.by_speed if row.level_db is not None]
    ends = min(levels), max(levels)
    return Answer(
        "How loud is it?",
        span(ends, ".1f", "dB") if ends[0] < ends[1] else bold(ends[0], ".1f", "dB"),
        _worth(found),
    )


def _worth(found: SceneFindings) -> str:
    """What the levels are worth, as the table of levels has it: one word where it is the same."""
    if not found.loaded.calibrated:
        return "relative: no measurement calibrated it"
    titles = found.cam_set.titles
    roles = {cam: curve.role for cam, curve in found.run.noise.curves.items()}
    by_role = {
        role: [titles[cam] for cam in roles if roles[cam] == role] for role in roles.values()
    }
    if len(by_role) == 1:
        return next(iter(by_role))
    return "; ".join(f"{role}: {', '.join(cams)}" for role, cams in by_role.items())


# The tables of a scene's page: those of the studies, and its laws and levels.


def tables(found: SceneFindings) -> dict[str, list[DataTable]]:
    """Every table of the page, by the section that shows it."""
    loaded, titles = found.loaded, found.cam_set.titles
    simulated = {cam: curve.level_db for cam, curve in found.run.noise.curves.items()}
    return {
        "summary": [summary_table(answers(found))],
        "cams": [_laws(found)],
        "contour": [
            table
            for cam, checks in found.checks.items()
            for table in ProfileResult(
                (CheckedCam(loaded.cams[cam], loaded.laws[cam], checks),)
            ).to_show()
        ],
        "turn": found.run.tables()[0].to_show(titles),
        "jump": found.jumps.to_show(titles),
        "vibration": found.vibration.tables()[0].to_show(titles) if found.vibration else [],
        "sound": [
            _level_table(found),
            *([recorded_table(found.recorded, simulated, titles)] if found.recorded else []),
            *OrdersResult(found.orders).speeds.to_show(titles),
        ],
        "numbers": [origins_table(name, model) for name, model in files(found).items()],
    }


def files(found: SceneFindings) -> dict[str, BaseModel]:
    """Every file with numbers that the page rests on."""
    loaded = found.loaded
    return {
        f"rig {loaded.rig.name}": loaded.rig,
        **{f"cam {name}": cam for name, cam in loaded.cams.items()},
        f"scene {loaded.scene.name}": loaded.scene,
    }


def _laws(found: SceneFindings) -> DataTable:
    """Lift, smoothness and peaks of each law, from exact roots."""

    def peak(order: int, end: int) -> Callable[[tuple[str, Law]], Cell]:
        return lambda row: 1e3 * extremes(row[1], order)[end].value

    titles = found.cam_set.titles
    return tabulate(
        "Motion laws: lift and extremes of its derivatives in the cam angle",
        found.loaded.laws.items(),
        (
            (Head("cam"), lambda row: titles[row[0]]),
            (Head("lift", "mm", ".4g"), lambda row: 1e3 * row[1].lift),
            (Head("continuity"), lambda row: continuity(row[1])),
            (Head("largest s′", "mm/rad", ".4g"), peak(1, 1)),
            (Head("smallest s′", "mm/rad", ".4g"), peak(1, 0)),
            (Head("largest s″", "mm/rad²", ".4g"), peak(2, 1)),
            (Head("smallest s″", "mm/rad²", ".4g"), peak(2, 0)),
            (Head("largest s‴", "mm/rad³", ".4g"), peak(3, 1)),
            (Head("smallest s‴", "mm/rad³", ".4g"), peak(3, 0)),
        ),
        "Times the cam's speed in rad/s, to the power of the derivative's order, they are those in "
        "time.",
    )


def _level_table(found: SceneFindings) -> DataTable:
    """The quietest and the loudest speed of each cam, and what the levels are worth."""
    titles = found.cam_set.titles
    return tabulate(
        "Sound pressure level over the scene's speeds",
        found.run.noise.curves.values(),
        (
            (Head("cam"), lambda curve: titles[curve.cam]),
            (Head("level is"), lambda curve: curve.role),
            (Head("lowest", "dB", ".1f"), lambda curve: float(curve.level_db.min())),
            (
                Head("at", "rpm", ".6g"),
                lambda curve: float(curve.rpm[curve.level_db.argmin()]),
            ),
            (Head("highest", "dB", ".1f"), lambda curve: float(curve.level_db.max())),
            (
                Head("at", "rpm", ".6g"),
                lambda curve: float(curve.rpm[curve.level_db.argmax()]),
            ),
            (
                Head("difference to published", "dB r.m.s.", ".2f"),
                lambda curve: curve.rmse_db,
            ),
        ),
        "" if found.loaded.calibrated else RELATIVE_NOTE,
    )


#: The sections in the order they are read: template, title.
SECTIONS = {
    "summary": "In short",
    "cams": "Cams and laws",
    "contour": "Contour and checks",
    "turn": "Contact over the turn",
    "jump": "Jump speed",
    "vibration": "Residual vibration",
    "sound": "Sound",
    "numbers": "Given, assumed, identified",
}


def html(found: SceneFindings, figures: dict[str, list[str]], made: Made) -> str:
    """One self-contained page; ``figures`` are data URIs by key, from the top."""
    return render("html", _document(found, figures, made))


def markdown(found: SceneFindings, made: Made) -> str:
    """The words and tables alone."""
    return render("md", _document(found, {}, made))


def _document(found: SceneFindings, figures: dict[str, list[str]], made: Made) -> Document:
    return Document(
        title=found.loaded.scene.title,
        sections=SECTIONS,
        made=made,
        tables=tables(found),
        figures=figures,
        values=_values(found),
        folder="scene/",
    )


def _values(found: SceneFindings) -> dict[str, Any]:
    """What the sections' sentences take their numbers from."""
    loaded = found.loaded
    origins = Counter(q.origin for model in files(found).values() for _, q in quantities(model, ""))
    return {
        "found": found,
        "scene": loaded.scene,
        "rig": loaded.rig,
        "calibrated": loaded.calibrated,
        "titles": found.cam_set.titles,
        "model": loaded.scene.model.replace("_", " "),
        "speeds": speeds_of(loaded),
        "failed": [
            (found.cam_set.titles[cam], check)
            for cam, checks in found.checks.items()
            for check in checks
            if not check.passed
        ],
        "seconds": rig_seconds(found.run),
        "highest": HIGHEST,
        "origins": ", ".join(f"{origins[origin]} {origin}" for origin in ORIGINS),
    }
