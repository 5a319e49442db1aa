"""The report's sections, one a file, in the order they are read."""

from __future__ import annotations

from cam_rig.report.blocks import Section
from cam_rig.report.results import Findings
from cam_rig.report.sections import (
    cams,
    jump,
    misprints,
    noise,
    numbers,
    question,
    summary,
    vibration,
)

ORDER = (summary, cams, vibration, jump, noise, question, numbers, misprints)


def sections(results: Findings) -> list[Section]:
    """Every section, written from the results."""
    return [module.section(results) for module in ORDER]
