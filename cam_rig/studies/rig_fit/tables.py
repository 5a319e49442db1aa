"""What a fit found of a rig, as tables and as plain data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from cam_rig.arrays import FloatArray
from cam_rig.schema.bench_tables.jump_table import JumpReading
from cam_rig.studies.rig_fit.found import FoundNumber, HoldFit, RigFit
from cam_rig.studies.rig_fit.jump_fit import JumpFit
from cam_rig.tables import Cell, Column, DataTable, tabulate
from cam_rig.units import rounded_to_error, to_rpm


def numbers_table(numbers: Iterable[FoundNumber], caption: str) -> DataTable:
    """A row a number: what was found, to the digits that its error leaves, or that nothing was."""

    def origin(number: FoundNumber) -> str:
        return "; ".join(filter(None, (number.origin, number.caution)))

    return tabulate(
        caption,
        numbers,
        (
            (Column("number"), lambda number: number.name),
            (Column("value", "", ".6g"), lambda number: number.shown),
            (Column("standard error", "", ".2g"), lambda number: number.shown_error),
            (Column("unit"), lambda number: number.unit),
            (Column(""), origin),
        ),
    )


def correlation_table(names: tuple[str, ...], correlation: FloatArray) -> DataTable:
    """How the errors of the identified numbers go together, -1 to 1."""
    return tabulate(
        "Correlation of their errors",
        range(len(names)),
        (
            (Column("number"), lambda i: names[i]),
            *(
                (Column(_short(name), "", ".2f"), lambda i, k=k: float(correlation[i, k]))
                for k, name in enumerate(names)
            ),
        ),
    )


def _short(name: str) -> str:
    """A heading of several lines."""
    return name.replace("_", " ")


def holds_table(fit: RigFit) -> DataTable:
    """Residuals of lift and force at each speed."""

    def micro(hold: HoldFit) -> Cell:
        return None if hold.lift is None else hold.lift * 1e6

    return tabulate(
        "Residuals, r.m.s.",
        fit.holds,
        (
            (Column("speed", "rpm", ".2f"), lambda hold: hold.rpm),
            (Column("turns", "", ".1f"), lambda hold: hold.turns),
            (Column("samples", "", "d"), lambda hold: hold.samples),
            (Column("lift", "µm", ".3g"), micro),
            (Column("force", "N", ".3g"), lambda hold: hold.force),
            (Column("lift-offs a turn", "", "d"), lambda hold: hold.lift_offs),
        ),
    )


def gauges_table(fit: RigFit) -> DataTable:
    """What the same samples say of the instruments."""
    g = fit.gauges
    rows: list[tuple[str, float | None, float | None, str]] = [
        ("encoder at θ = 0", math.degrees(g.offset), math.degrees(g.offset_error), "deg"),
        ("sensors' clock, fast by", _times(g.clock, 1e6), _times(g.clock_error, 1e6), "ppm"),
        ("zero offset of the lift", _times(g.zero, 1e6), _times(g.zero_error, 1e6), "µm"),
        ("backlash of the lift", _times(g.backlash, 1e6), _times(g.backlash_error, 1e6), "µm"),
        ("noise of the lift", _times(g.lift_noise, 1e6), None, "µm"),
        ("zero offset of the force", g.force_zero, g.force_zero_error, "N"),
        ("noise of the force", g.force_noise, None, "N"),
        ("and of the force itself", _times(g.force_part or None, 100.0), None, "%"),
        ("resonance of the force sensor", g.sensor_frequency, None, "Hz"),
        ("its damping ratio", _times(g.sensor_damping, 100.0), None, "%"),
    ]
    return tabulate(
        "The instruments, by the same samples",
        [row for row in rows if row[1] is not None],
        (
            (Column(""), lambda row: row[0]),
            (Column("value", "", ".4g"), lambda row: _digits(row[1], row[2])),
            (Column("standard error", "", ".2g"), lambda row: row[2]),
            (Column("unit"), lambda row: row[3]),
        ),
    )


def _digits(value: float | None, error: float | None) -> Cell:
    """A value to the digits of its error, if it has one."""
    return value if value is None or error is None else rounded_to_error(value, error)


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def numbers_json(numbers: Iterable[FoundNumber]) -> dict[str, Any]:
    """By name; null where nothing tells it, and why."""
    return {
        n.name: {
            "value": n.value,
            "standard_error": n.error if n.value is not None else None,
            "unit": n.unit,
            "origin": n.origin,
            **({"caution": n.caution} if n.caution else {}),
            **({"reason": n.reason} if n.reason else {}),
        }
        for n in numbers
    }


def rig_json(fit: RigFit) -> dict[str, Any]:
    """All that a fit found, SI."""
    return {
        "source": str(fit.run.source),
        "cam": fit.law.name,
        "model": fit.model,
        "numbers": numbers_json(fit.numbers),
        "correlation": {
            "of": list(fit.correlated),
            "matrix": fit.correlation.tolist(),
        },
        "instruments": {
            "encoder_offset_rad": fit.gauges.offset,
            "sensor_clock_fast_by": fit.gauges.clock,
            "lift_zero_m": fit.gauges.zero,
            "lift_backlash_m": fit.gauges.backlash,
            "lift_noise_m": fit.gauges.lift_noise,
            "force_noise_N": fit.gauges.force_noise,
            "force_noise_part": fit.gauges.force_part,
            "force_sensor_resonance_Hz": fit.gauges.sensor_frequency,
        },
        "by_speed": [
            {
                "rpm": hold.rpm,
                "turns": hold.turns,
                "samples": hold.samples,
                "lift_rms_m": hold.lift,
                "force_rms_N": hold.force,
                "lift_offs_per_turn": hold.lift_offs,
            }
            for hold in fit.holds
        ],
        "notes": list(fit.run.notes),
    }


def jumps_table(fit: JumpFit) -> DataTable:
    """Jump speeds as read, and of the numbers found."""
    rows = list(zip(fit.table.readings, fit.speeds, fit.left.tolist(), strict=True))

    def known(name: str) -> Callable[[tuple[JumpReading, float, float]], Cell]:
        return lambda row: row[0].known.get(name)

    return tabulate(
        "Jump speeds",
        rows,
        (
            (Column("line", "", "d"), lambda row: row[0].line),
            (Column("mass put on", "kg", ".6g"), known("mass")),
            (Column("spring", "N/m", ".6g"), known("spring_stiffness")),
            (Column("preload", "N", ".6g"), known("preload")),
            (Column("read", "rpm", ".2f"), lambda row: float(to_rpm(row[0].speed))),
            (Column("fitted", "rpm", ".2f"), lambda row: row[1]),
            (Column("residual", "rpm", ".2f"), lambda row: -row[2]),
        ),
    )


def jumps_json(fit: JumpFit) -> dict[str, Any]:
    """All that a fit of jump speeds found, SI but for rpm."""
    return {
        "source": fit.table.file,
        "cam": fit.law.name,
        "model": fit.model,
        "numbers": numbers_json(fit.numbers),
        "correlation": {
            "of": [number.name for number in fit.identified],
            "matrix": fit.correlation.tolist(),
        },
        "error_rpm": fit.error,
        "error_given": fit.error_given,
        "degrees_of_freedom": fit.free,
        "readings": [
            {"line": r.line, "read_rpm": float(to_rpm(r.speed)), "found_rpm": speed, **r.known}
            for r, speed in zip(fit.table.readings, fit.speeds, strict=True)
        ],
    }
