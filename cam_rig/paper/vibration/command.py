"""cam-rig vibration: residual and torsional vibration of cams, and what the paper says of them."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.show.command import (
    CamsOrScene,
    Csv,
    Json,
    Plot,
    RigOfScene,
    check_outputs,
    progress_bar,
    say,
    show,
    user_errors,
    write_csv,
    write_json,
    write_plot,
)

#: The jump speed of the first of the paper's laws is 389 rpm.
SPEEDS = [200.0, 250.0, 300.0, 350.0]


def vibration(
    cams: CamsOrScene = None,
    rig: RigOfScene = None,
    rpm: Annotated[list[float] | None, typer.Option(help="Speed; may be given often.")] = None,
    json_target: Json = None,
    csv: Csv = None,
    plot: Plot = None,
) -> None:
    """Measure residual vibration in the low dwell, peak acceleration, and twist of the shaft.

    Eq. 5 and eq. 10 of the paper, in steady state. The residual amplitude is of the free vibration
    that a law's joints excite; a law without a low dwell is read within 31.25° of its lowest lift.
    † marks cams whose follower loses contact below a speed: the model holds it on, and the paper's
    claims are tested without that speed. The plot shows the last speed. By default up to four
    speeds of a scene; 200, 250, 300 and 350 rpm, below every jump speed of the paper's laws.

    Examples
    --------
    cam-rig vibration --plot out/vibration.png

    cam-rig vibration poly345 poly4567 --rig tm21 --rpm 300 --json -

    cam-rig vibration quick --rig paper_table2
    """
    from cam_rig.schema.load import one_scene
    from cam_rig.simulation.asked import asked_cams, scene_speeds

    with user_errors():
        from cam_rig.paper.vibration import study
        from cam_rig.paper.vibration.study import vibration_claims, vibration_table

        check_outputs(json_target, plot, csv)
        cam_set, scene = asked_cams(cams, rig), one_scene(cams)
        own = SPEEDS if scene is None else scene_speeds(scene, len(SPEEDS))
        with progress_bar() as bar:
            task = bar.add_task("", total=len(cam_set.cams), completed=-1)
            speeds = tuple(rpm or own)  # a speed given twice is one
            found = vibration_table(
                cam_set, speeds, lambda cam: bar.update(task, advance=1, description=cam)
            )
        shown = [study.speed_table(found, speed, cam_set.rig.name) for speed in found.rpm]
        if claims := vibration_claims(found):
            shown.append(study.claims_table({cam_set.rig.name: claims}, found.rpm))
        show(*shown)
        if lost := len(found.rpm) - len(found.in_contact):
            say(f"contact is lost at {lost} of {len(found.rpm)} speeds: no claim is tested there")
        write_csv(shown, csv)
        if plot is not None:
            from cam_rig.paper.vibration.figures import figure

            write_plot(plot, lambda: figure(cam_set, speeds[-1]))
        write_json(study.to_json(found), json_target)
