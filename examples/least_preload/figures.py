"""Figure of the lowest preload against speed, with a line per cam."""

from __future__ import annotations

from matplotlib.figure import Figure

from cam_rig.show.figure import empty, line, styled
from cam_rig.show.looks import title_of

from .study import PreloadResult


@styled
def figure(result: PreloadResult) -> Figure:
    """Draw the lowest preload of each cam, and the preload of the rig."""
    out = empty(3.4)
    axes = out.subplots()
    for cam in result.cam_set.laws:
        rows = [row for row in result.rows if row.cam == cam]
        name = title_of(result.cam_set.titles, cam)
        axes.plot([r.rpm for r in rows], [r.least for r in rows], label=name, **line(cam))
    axes.axhline(result.rows[0].rig, color="0.3", lw=0.9, label="the rig's own")
    axes.set(xlabel="cam speed [rpm]", ylabel="least preload [N]")
    axes.legend()
    return out
