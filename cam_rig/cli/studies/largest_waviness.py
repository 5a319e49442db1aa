"""cam-rig campaign --largest-waviness: what waviness each wavelength may have."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cam_rig.cli.common.console import progress_bar, show
from cam_rig.cli.common.outputs import write_csv, write_json, write_plot

if TYPE_CHECKING:
    from cam_rig.studies.campaign.campaign import Campaign


def show_largest(
    campaign: Campaign,
    count: int,
    jobs: int | None,
    dask: str | None,
    plot: Path | None,
    csv: Path | None,
    json_target: str | None,
) -> None:
    """Search so many wavelengths behind a bar; table, picture and files.

    Raises
    ------
    ConfigError : a study without limits or waviness
    RunError : the workers are gone
    OutputError : a file cannot be written
    """
    from cam_rig.cli.common.executors import workplace
    from cam_rig.studies.campaign.largest_waviness import WavinessSearch, find_largest
    from cam_rig.studies.campaign.tables import waviness_json, waviness_table

    search = WavinessSearch(campaign)
    wavelengths = search.wavelengths(count)
    with workplace(jobs, dask) as place, progress_bar() as bar:
        task = bar.add_task(campaign.config.name, total=wavelengths.size)
        found = find_largest(search, wavelengths, place.executor, lambda: bar.advance(task))
    table = waviness_table(search, found)
    show(table)
    write_csv([table], csv)
    if plot is not None:
        from cam_rig.plots.campaign.waviness import draw

        write_plot(plot, lambda part: draw(search, found, part))
    write_json(waviness_json(search, found), json_target)
