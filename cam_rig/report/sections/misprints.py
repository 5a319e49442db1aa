"""How the sources were read, and how this page is made."""

from __future__ import annotations

from cam_rig import __version__
from cam_rig.report.blocks import Grid, Section, Words
from cam_rig.report.results import Findings

MISPRINTS = (
    ("Table 1, mass", "13 kg", "1.3 kg"),
    ("control polygon of Bézier 15", "…1.5, 15, …", "…1.5, 1.5, …"),
    ("eq. 2, two coefficients", "45045, 434434", "4504.5, 4344.34"),
    ("eq. 20, constant", "2593808", "25.93808"),
)


def section(results: Findings) -> Section:
    """Misprints taken as corrected, and the commands behind each part."""
    return Section(
        "reading",
        "How the paper was read, and how this was made",
        (
            Grid("Misprints of the paper", ("where", "printed", "read as"), MISPRINTS, left=3),
            Words(
                "Table 3, the measured levels, was lost in the scan; figs. 3, 7, 8, 10 and 13-15 "
                "are drawings and photographs of the machine. Each part by itself: cam-rig laws, "
                "profile, vibration, jump, noise, factorial; this page: cam-rig report. "
                f"cam_rig {__version__}; the same files give the same page."
            ),
        ),
    )
