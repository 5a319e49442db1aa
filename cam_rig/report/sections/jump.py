"""Jump speed: figs. 10 and 11, Table 2."""

from __future__ import annotations

import math

from cam_rig.report.blocks import Block, Grid, Picture, Section, Words
from cam_rig.report.figures import TAKEOFF_RPM
from cam_rig.report.results import Findings
from cam_rig.studies.jump.comparison import JumpRow, rms_words, same_ranking, turn_of
from cam_rig.studies.jump.contact_limit import FROM_REST
from cam_rig.studies.jump.refit import ROUNDED_TO
from cam_rig.units import RPM


def section(results: Findings) -> Section:
    """The table, the force behind it, and what it is worth."""
    blocks: tuple[Block, ...] = (
        _table(results),
        Words(_worth(results)),
        Picture(
            "jump",
            "The least contact force of a run at each speed. It is not monotone: where a harmonic "
            "of the speed meets the stem's own frequency the follower may be thrown off, and be "
            "followed again a little faster. The jump speed is the lowest zero, so all slower "
            "speeds are gone through, finer than the ringing's phase turns.",
        ),
        Picture(
            "fig11",
            f"Fig. 11: the two-mass follower at {TAKEOFF_RPM:g} rpm, above every jump speed but "
            "Bézier 15's. The bump at the end of the rise is the flight that the paper shows.",
        ),
    )
    return Section("jump", "Jump speed", blocks)


def _table(results: Findings) -> Grid:
    rigid = {cam: m.rigid_jump / RPM for cam, m in results.factorial.cams.items()}
    titles = results.sources.cam_set.titles
    rows = [_row(row, titles[row.cam], rigid[row.cam]) for row in results.jumps]
    head = (
        "law",
        "part",
        "Table 2 [rpm]",
        "here [rpm]",
        "difference",
        "steady state [rpm]",
        "rigid [rpm]",
        "at [°]",
        "Table 2 [s]",
        "here [s]",
    )
    return Grid(
        f"Table 2. Jump speed, {FROM_REST:g} s from rest at constant speed",
        head,
        tuple(rows),
        left=2,
        note="Fitted: identified event angle, stem, mass split and preload. Test: nothing was "
        "fitted to it. No part: neither, on this rig. Rigid: one mass on the same spring, which "
        "cannot ring; on the stem that the paper prints it is nearly that. Angle and time are of "
        "the first lift-off at the jump speed itself.",
    )


def _row(row: JumpRow, title: str, rigid: float) -> tuple[str, ...]:
    return (
        title,
        row.role,
        "" if row.published_rpm is None else f"{row.published_rpm:g}",
        f"{row.found.rpm:.2f}",
        "" if row.difference is None else f"{100.0 * row.difference:+.2f} %",
        "" if row.steady is None else f"{row.steady.rpm:.2f}",
        f"{rigid:.1f}",
        f"{math.degrees(row.found.angle):.1f}",
        "" if row.published_time is None else f"{row.published_time:.2f}",
        f"{row.found.time:.3f}",
    )


def _worth(results: Findings) -> str:
    rows = results.jumps
    turns = [turn for turn in map(turn_of, rows) if turn is not None]
    ours, theirs = ([turn[i] for turn in turns] for i in (0, 1))
    ranking = "is the paper's" if same_ranking(rows) else "is not the paper's"
    printed = [row.published_rpm for row in rows if row.published_rpm]
    rounding = ROUNDED_TO / math.sqrt(12.0) * math.sqrt(sum(x**-2 for x in printed) / len(printed))
    angles = [math.degrees(row.found.angle) for row in rows]
    degrees = ", ".join(f"{d}: {rpm:.0f} rpm" for d, rpm in results.degrees.items())
    return (
        f"{rms_words(rows)}; the ranking of all "
        f"five {ranking}. Table 2 rounds to {ROUNDED_TO:g} rpm, which alone makes "
        f"{100.0 * rounding:.2f} %: a better fit would say no more. Nor is the rig the "
        "only one: four numbers to four speeds have a second solution as good, which "
        "cam-rig jump --refit finds and tells with its fifth law and times; the source of the "
        "rig's stem, below, has its numbers. The ± of that refit is one standard error from the "
        "rounding, close about one solution, and does not reach to the other. The fifth law's "
        f"degree is not printed. By the degree of its half-rises it is left at {degrees}; degree "
        "6 is taken, as smooth as Bézier 15's ordinates ask for (C3), so it tests the rig only as "
        "far as that reading is right. The time column is not reproduced: here the cam is "
        f"first left after {min(ours):.1f} to {max(ours):.1f} turns, in the paper "
        f"after {min(theirs):.1f} to {max(theirs):.1f}. At the jump speed itself the force "
        "only just touches zero, turn after turn by almost the same, so when it does first is a "
        "matter of the last digits of the speed. "
        f"All five are first left between {min(angles):.0f}° and {max(angles):.0f}°, in the "
        "fall or just behind it, where damping lifts the follower; the paper's fig. 11 shows the "
        "end of the rise, which follows at somewhat higher speeds."
    )
