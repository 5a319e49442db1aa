"""cam-rig campaign: thousands of rigs that differ in some numbers, on this machine or a cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.cli.common.console import say, show, user_errors
from cam_rig.cli.common.names import campaign_path
from cam_rig.cli.common.options import Csv, Dask, Jobs, Json, Plot
from cam_rig.cli.common.outputs import check_outputs, write_csv, write_json, write_plot
from cam_rig.cli.studies.largest_waviness import show_largest
from cam_rig.errors import ConfigError, DynamicsError, OutputError, RunError

if TYPE_CHECKING:
    from cam_rig.studies.campaign.campaign import Campaign
    from cam_rig.studies.campaign.dataset import CampaignDataset


Wavelengths = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        min=1,
        max=1000,
        help="Instead: the largest waviness with which 99 % keep the study's limits, for N "
        "wavelengths. It keeps no rows: refused with --out and with --resume.",
    ),
]


def campaign(
    study: Annotated[str, typer.Argument(help="Study file, or a name in config/campaigns.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Of the dataset; by default out/NAME.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the points that the folder has not.")
    ] = False,
    points: Annotated[int | None, typer.Option(help="Points, in place of the study's.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed, in place of the study's.")] = None,
    largest_waviness: Wavelengths = None,
    jobs: Jobs = None,
    dask: Dask = None,
    plot: Plot = None,
    csv: Csv = None,
    json_target: Json = None,
) -> None:
    """Measure thousands of rigs that differ in some numbers, and keep a row of each.

    The study says what varies, at which points, and what is measured: jump speeds, vibration,
    forces, levels. Rows go into a folder of Parquet files, readable while it runs; tables of
    quantiles, yields and shares follow. Rows are the same on any number of processes, and on a
    Dask cluster. Ctrl-C keeps what is finished; --resume goes on.

    Examples
    --------
    cam-rig campaign tolerance_poly345 --points 256 --plot out/tolerances.png

    cam-rig campaign jump_map --out out/map --resume

    cam-rig campaign tolerance_poly345 --points 64 --largest-waviness 24
    """
    with user_errors():
        from cam_rig.cli.common.executors import check_workplace
        from cam_rig.studies.campaign.campaign import open_campaign

        check_outputs(json_target, plot, csv)
        check_workplace(dask)
        asked = open_campaign(campaign_path(study)).planned(points, seed)
        if largest_waviness is not None:
            if out is not None or resume:
                raise ConfigError(
                    "--largest-waviness: keeps no rows; allowed: without --out and --resume"
                )
            show_largest(asked, largest_waviness, jobs, dask, plot, csv, json_target)
            return
        folder = out or Path("out") / asked.config.name
        again = _command(study, folder, points, seed, jobs, dask)
        dataset = _measured(folder, asked, resume, jobs, dask, again)
        _show_results(dataset, plot, csv, json_target)


def _show_results(
    dataset: CampaignDataset, plot: Path | None, csv: Path | None, json_target: str | None
) -> None:
    """What the rows come to: tables, a picture, files."""
    from cam_rig.studies.campaign.results import CampaignResults
    from cam_rig.studies.campaign.tables import result_tables, to_json

    results = CampaignResults(dataset)
    if results.failed == results.points:
        raise DynamicsError(
            f"{dataset.campaign.config.name}: {results.failures}; the rows in {dataset.folder} "
            "have the reason of each; remedy: other numbers in the study's vary"
        )
    shown = result_tables(results)
    show(*shown)
    say(f"dataset: {dataset.folder}/*.parquet")
    write_csv(shown, csv)
    if plot is not None:
        from cam_rig.plots.campaign import draw

        write_plot(plot, lambda part: draw(results, part))
    write_json(to_json(results), json_target)


def _command(
    study: str,
    folder: Path,
    points: int | None,
    seed: int | None,
    jobs: int | None,
    dask: str | None,
) -> str:
    """The command that goes on where this one ends."""
    import shlex

    given = {"--points": points, "--seed": seed, "--jobs": jobs, "--dask": dask}
    words = ["cam-rig", "campaign", study, "--out", str(folder), "--resume"]
    for option, value in given.items():
        words += [] if value is None else [option, str(value)]
    return shlex.join(words)


def _measured(
    folder: Path, asked: Campaign, resume: bool, jobs: int | None, dask: str | None, again: str
) -> CampaignDataset:
    """Make the points that are missing, with their progress; what ends it says how to go on.

    Raises
    ------
    CamRigError : the folder is another's, the disk is full, or the workers are gone
    """
    from cam_rig.cli.common.executors import workplace
    from cam_rig.cli.common.progress import CampaignProgress
    from cam_rig.extras import require
    from cam_rig.studies.campaign.dataset import CampaignDataset
    from cam_rig.studies.campaign.run import run_campaign

    require("pyarrow")
    dataset = CampaignDataset(folder, asked)
    with dataset.opened(resume) as damaged, _going_on(again):
        if damaged:
            say(damaged)
        if not dataset.missing():
            return dataset
        with workplace(jobs, dask) as place, CampaignProgress(dataset) as progress:
            run_campaign(dataset, place.executor, place.count, progress.advance)
    return dataset


@contextmanager
def _going_on(again: str) -> Iterator[None]:
    """Ends of a run that leave something to go on with: the command that does is named."""
    try:
        yield
    except KeyboardInterrupt as interrupt:
        interrupt.args = (f"{interrupt}; what is finished stays, go on with: {again}",)
        raise
    except (OutputError, RunError) as error:
        raise type(error)(f"{error}; go on with: {again}") from None
