"""cam-rig as-cut: a cam whose contour was drawn for a point, driven with a roller."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.show.command import (
    DEFAULT_SCENE,
    Csv,
    Json,
    Plot,
    Rig,
    SceneOption,
    TableCams,
    check_outputs,
    user_errors,
    write_csv,
    write_json,
    write_plot,
)
from cam_rig.show.terminal import say, show

Millimetres = Annotated[
    float | None, typer.Option(help="Radius in mm, instead of the cam's own.", show_default=False)
]


def as_cut(
    cams: TableCams = None,
    rig: Rig = "paper_table2",
    scene: SceneOption = DEFAULT_SCENE,
    base: Millimetres = None,
    roller: Millimetres = None,
    plot: Plot = None,
    json_target: Json = None,
    csv: Csv = None,
) -> None:
    """Drive a roller on the contour of a point, as fig. 12 of the paper draws it.

    The paper plots R_b + s over the angle: the contour of a point follower. A roller on it touches
    beside its guide and stands above s. Its lift, jump speed and noise beside those of s itself.
    The scene gives the follower, sound and speeds of the noise. The plot shows the first cam.

    Examples
    --------
    cam-rig as-cut

    cam-rig as-cut bezier15 --base 80 --roller 20 --plot out/as_cut.png
    """
    from cam_rig.schema.load import cam_path, rig_path, scene_path, tables_path

    with user_errors():
        from cam_rig.errors import ConfigError
        from cam_rig.laws.cam import open_cam_set
        from cam_rig.paper.as_cut import study
        from cam_rig.schema import load_tables
        from cam_rig.simulation.scene import open_scene

        check_outputs(json_target, plot, csv)
        for option, value in (("--base", base), ("--roller", roller)):
            if value is not None and not value > 0.0:
                raise ConfigError(f"{option}: is {value:g} mm; allowed: greater than 0 mm")
        names = cams or list(load_tables(tables_path()).table_2_jump)
        cam_set = open_cam_set(map(cam_path, names), rig_path(rig))
        bench = study.CutBench.of(cam_set.rig, open_scene(scene_path(scene)))
        found = {}
        for name, law in cam_set.laws.items():
            own, given = study.radii(cam_set.cams[name]), (base, roller)
            radii = [r if mm is None else 1e-3 * mm for r, mm in zip(own, given, strict=True)]
            drawn = study.DrawnCam.run(law, bench)
            found[name] = study.as_cut(drawn, bench, *radii)
        table = study.cams_table(found, {})
        show(table)
        first, row = next(iter(found.items()))
        change = max(map(abs, row.level_change))
        say(f"{first}: {row.too_high.value * 1e3:.3f} mm too high, noise within {change:.3f} dB")
        write_csv([table], csv)
        write_json(study.to_json(found), json_target)
        if plot is not None:
            from cam_rig.paper.as_cut.figures import figure

            write_plot(plot, lambda: figure(row, cam_set.titles[first]))
