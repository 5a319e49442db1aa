"""A scene's page in short: what each cam does on its rig, as questions and answers."""

from __future__ import annotations

import math
from collections.abc import Iterator

from cam_rig.report.scene.results import SceneFindings, speeds_of
from cam_rig.report.summary import Answer, bold, span


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
    for row in found.jumps:
        where = "below" if row.found.rpm < fastest else "above"
        yield Answer(
            f"What is the jump speed of {found.cam_set.titles[row.cam]}?",
            f"{bold(row.found.rpm, '.1f', 'rpm')} ({found.jump_run}); contact is lost at "
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
