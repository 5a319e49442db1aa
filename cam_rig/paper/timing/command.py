"""cam-rig timing: when a cam has lifted its follower, and what each ordinate moves."""

from __future__ import annotations

from pathlib import Path

from cam_rig.show.command import TableCams, command
from cam_rig.show.result import Result


@command("plot", "json", "csv")
def timing(cams: TableCams = None, *, plot: Path | None) -> Result:
    """List the cam angles of 1, 50 and 99 % of the lift; of one cam, what each ordinate moves.

    Angles are roots of the law. Their change with an ordinate is exact, by implicit
    differentiation. A cam of one Bézier curve is put beside a B-spline of the same lift and events,
    which has local control. The plot shows the first cam.

    In Python: cam_rig.timing(cams)

    Examples
    --------
    cam-rig timing

    cam-rig timing bezier15 --plot out/timing.png --csv out/timing.csv
    """
    from cam_rig.errors import ConfigError
    from cam_rig.paper.timing import study

    found = study.timing(cams)
    first = found.timings[0]
    if plot is not None and not first.ordinates:
        raise ConfigError(
            f"cam {first.cam.name!r} has no ordinates to plot; allowed: a Bézier curve, a "
            "B-spline or a polynomial rise"
        )
    return found
