"""cam-rig readings: the paper's Table 2 read in several ways."""

from __future__ import annotations

from typing import Annotated

import typer

from cam_rig.show.command import command
from cam_rig.show.result import Progress, Result


@command("json", "csv")
def readings(
    search: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Seek the identified numbers of a reading anew."),
    ] = None,
    with_times: Annotated[
        bool, typer.Option("--with-times", help="Of --search: by the printed times too.")
    ] = False,
    nearby: Annotated[
        bool,
        typer.Option(
            "--nearby", help="Of --search: contact need hold 5 rpm below each speed, no slower."
        ),
    ] = False,
    generations: Annotated[
        int, typer.Option(min=1, max=10_000, help="Of --search: how long to seek.")
    ] = 60,
    seed: Annotated[int, typer.Option(min=0, help="Of --search.")] = 1,
    *,
    progress: Progress,
) -> Result:
    """Read Table 2 of the paper in several ways: which rig shows its speeds, and its times.

    The paper prints neither the event angles nor all of the rig. Each reading takes some numbers
    as given and identifies the rest. It is looked at as the table is printed, every 5 rpm.

    Examples
    --------
    cam-rig readings

    cam-rig readings --search shipped --generations 20
    """
    from cam_rig.errors import ConfigError
    from cam_rig.paper.readings.study import read_all, search_anew
    from cam_rig.schema import load_cam, load_readings, load_tables
    from cam_rig.schema.load import cam_path, readings_path, tables_path

    if search is None and (with_times or nearby):
        raise ConfigError("--with-times, --nearby: are of a search; needed: --search NAME")
    known, printed = load_readings(readings_path()), load_tables(tables_path()).table_2_jump
    cams = {cam: load_cam(cam_path(cam)) for cam in printed}
    if search is None:
        return read_all(known, cams, printed, progress)
    return search_anew(
        known,
        search,
        cams,
        printed,
        with_times=with_times,
        nearby=nearby,
        generations=generations,
        seed=seed,
        progress=progress,
    )
