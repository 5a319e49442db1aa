"""cam-rig readings: the paper's Table 2 read in several ways."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.show.command import (
    Csv,
    check_outputs,
    progress_bar,
    user_errors,
    write_csv,
)
from cam_rig.show.terminal import say, show

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cam_rig.paper.readings.readings import Read
    from cam_rig.schema import TableReading, TableReadings


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
    csv: Csv = None,
) -> None:
    """Read Table 2 of the paper in several ways: which rig shows its speeds, and its times.

    The paper prints neither the event angles nor all of the rig. Each reading takes some numbers
    as given and identifies the rest. It is looked at as the table is printed, every 5 rpm.

    Examples
    --------
    cam-rig readings

    cam-rig readings --search shipped --generations 20
    """
    from cam_rig.schema.load import readings_path

    with user_errors():
        from cam_rig.errors import ConfigError
        from cam_rig.paper.readings import tables
        from cam_rig.schema import load_readings

        check_outputs(None, None, csv)
        known = load_readings(readings_path())
        looked_at = known.readings
        if search is not None:
            looked_at = _search(known, search, with_times, nearby, generations, seed)
        elif with_times or nearby:
            raise ConfigError("--with-times, --nearby: are of a search; needed: --search NAME")
        found = _read(looked_at, known.run_s)
        shown = [
            tables.numbers_table(looked_at),
            tables.speeds_table(found),
            tables.times_table(found),
        ]
        show(*shown)
        say(tables.conclusion(found))
        write_csv(shown, csv)


def _read(readings: Mapping[str, TableReading], run: float) -> list[Read]:
    """Every reading on every cam of the table, behind a bar."""
    from cam_rig.paper.readings.readings import read
    from cam_rig.schema import load_cam, load_tables
    from cam_rig.schema.load import cam_path, tables_path

    printed = load_tables(tables_path()).table_2_jump
    cams = {cam: load_cam(cam_path(cam)) for cam in printed}
    found = []
    with progress_bar() as bar:
        task = bar.add_task("", total=len(readings))
        for name, reading in readings.items():
            bar.update(task, description=name)
            found.append(read(name, reading, cams, printed, run))
            bar.advance(task)
    return found


def _search(
    known: TableReadings, name: str, with_times: bool, nearby: bool, generations: int, seed: int
) -> dict[str, TableReading]:
    """Seek a reading's identified numbers anew; Ctrl-C ends it with nothing found.

    Raises
    ------
    ConfigError : no such reading
    """
    from cam_rig.errors import ConfigError, did_you_mean
    from cam_rig.paper.readings.search import ReadingSearch
    from cam_rig.paper.readings.tables import with_numbers
    from cam_rig.schema import load_cam, load_tables
    from cam_rig.schema.load import cam_path, tables_path

    if name not in known.readings:
        raise ConfigError(
            f"--search: is {name!r}{did_you_mean(name, known.readings)}; allowed: "
            f"{', '.join(known.readings)}"
        )
    printed = load_tables(tables_path()).table_2_jump
    cams = {cam: load_cam(cam_path(cam)) for cam in printed}
    search = ReadingSearch.of(known.readings[name], cams, printed, with_times, known.run_s, nearby)
    with progress_bar() as bar:
        task = bar.add_task(name, total=generations)
        found = search.best(
            generations,
            seed,
            lambda done, miss: bar.update(
                task, completed=done, description=f"{name}, best misses {miss:.2f} rpm in all"
            ),
        )
    say(f"best of {found.trials} trials; its numbers, and what they show by the exact model:")
    return {name: with_numbers(known.readings[name], found)}
