"""cam-rig timing: when a cam has lifted its follower, and what each ordinate moves."""

from __future__ import annotations

from cam_rig.show.command import (
    Csv,
    Json,
    Plot,
    TableCams,
    check_outputs,
    user_errors,
    write_csv,
    write_json,
    write_plot,
)
from cam_rig.show.terminal import say, show


def timing(
    cams: TableCams = None,
    plot: Plot = None,
    json_target: Json = None,
    csv: Csv = None,
) -> None:
    """List the cam angles of 1, 50 and 99 % of the lift; of one cam, what each ordinate moves.

    Angles are roots of the law. Their change with an ordinate is exact, by implicit
    differentiation. A cam of one Bézier curve is put beside a B-spline of the same lift and events,
    which has local control. The plot shows the first cam.

    Examples
    --------
    cam-rig timing

    cam-rig timing bezier15 --plot out/timing.png --csv out/timing.csv
    """
    from cam_rig.schema.load import cam_path, tables_path

    with user_errors():
        from cam_rig.errors import ConfigError
        from cam_rig.laws.cam import law_of
        from cam_rig.paper.timing import tables
        from cam_rig.paper.timing.tables import CamTiming, beside_b_spline
        from cam_rig.schema import load_cam, load_tables

        check_outputs(json_target, plot, csv)
        names = cams or list(load_tables(tables_path()).table_2_jump)
        loaded = [(path, load_cam(path)) for path in map(cam_path, names)]
        found = [CamTiming.of(cam, law_of(path, cam)) for path, cam in loaded]
        first = found[0]
        if plot is not None and not first.ordinates:
            raise ConfigError(
                f"cam {first.cam.name!r} has no ordinates to plot; allowed: a Bézier curve, a "
                "B-spline or a polynomial rise"
            )
        shown, beside = [tables.events_table(found, by_name=True)], beside_b_spline(first)
        if len(found) == 1:
            shown += [tables.ordinates_table(first, ordinates) for ordinates in first.ordinates]
            shown += [tables.control_table(beside)] if beside else []
        show(*shown)
        if len(found) > 1:
            say("one cam alone is shown with what each of its ordinates moves")
        write_csv(shown, csv)
        write_json(tables.to_json(found), json_target)
        if plot is not None:
            from cam_rig.paper.timing.figures import figure

            columns = [control.timing for control in beside] or [first]
            write_plot(plot, lambda: figure(columns))
