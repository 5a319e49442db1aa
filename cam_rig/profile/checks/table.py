"""A cam's checks as a table."""

from __future__ import annotations

from cam_rig.laws import Law
from cam_rig.profile.checks.check import Check
from cam_rig.schema import CamConfig
from cam_rig.tables import Column, DataTable, tabulate


def checks_table(cam: CamConfig, law: Law, checks: list[Check]) -> DataTable:
    """A row for each check: value, cam angle, limit, result."""
    kind = cam.follower.type.replace("_", " ")
    return tabulate(
        f"{cam.title}: {kind} follower, lift {law.lift * 1e3:.5g} mm",
        checks,
        (
            (Column("check"), lambda check: check.title),
            (Column("value"), lambda check: check.shown(check.value)),
            (Column("at", "°", ".1f"), lambda check: check.degrees),
            (Column("allowed"), lambda check: check.allowed),
            (Column("result"), lambda check: "ok" if check.passed else "fails"),
        ),
    )
